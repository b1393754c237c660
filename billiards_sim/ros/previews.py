# SPDX-License-Identifier: Apache-2.0
"""The previews that the table owes: one after the other, and a piece at a tick, so that they hold up none."""

from __future__ import annotations

from collections import deque

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from billiards_sim.command_line import one_line
from billiards_sim.engine.simulation import Simulation, StallError
from billiards_sim.ros import markers
from billiards_sim.ros.answers import answer, check_at_rest
from billiards_sim.ros.messages import Stamps, stamp_of
from billiards_sim.ros.preview import Prediction, Preview, preview_json
from billiards_sim.ros.qos import ANSWER_DEPTH, STATE_DEPTH
from billiards_sim.ros.wrench import shot_from_wrench

MOST_PREVIEWS = 100
"""That wait for their tick; more are refused."""

BUDGET = 0.01
"""s of the wall clock that a tick goes on with a preview: enough for a break, where the engine is compiled."""


class Previews:
    """Takes what people ask on `cue_shot/preview`, answers on `preview/result` and draws on `preview`."""

    def __init__(self, node: Node) -> None:
        self._drawing = node.create_publisher(MarkerArray, "preview", STATE_DEPTH)
        self._results = node.create_publisher(String, "preview/result", ANSWER_DEPTH)
        self._waiting: deque[WrenchStamped] = deque()
        self._begun: tuple[WrenchStamped, Prediction] | None = None

    def ask(self, message: WrenchStamped, time: float) -> None:
        """Let a shot wait for its tick. At a simulated time, s."""
        if len(self._waiting) < MOST_PREVIEWS:
            self._waiting.append(message)
        else:
            reason = f"{MOST_PREVIEWS} previews wait already, one a tick is answered at most"
            answer(self._results, message, time, reason)

    def go_on(self, simulation: Simulation, stamps: Stamps, frame: str) -> None:
        """Answer one, or play on with it.

        Args:
            simulation: what is on the table.
            stamps: of its times.
            frame: of the messages.
        """
        if self._begun is None and not self._waiting:
            return
        message = self._waiting.popleft() if self._begun is None else self._begun[0]
        preview: Preview | None = None
        try:
            prediction = self._begin(message, simulation, frame) if self._begun is None else self._begun[1]
            preview = prediction.go_on(BUDGET)
        except (ValueError, StallError) as error:
            answer(self._results, message, simulation.time, one_line(error))
        else:
            if preview is None:
                self._begun = message, prediction
                return
            self._results.publish(String(data=preview_json(preview, stamps, stamp_of(message))))
        self._begun = None
        if self._drawing.get_subscription_count() > 0:
            self._drawing.publish(markers.preview_markers(preview, stamps.at(simulation.time), frame))

    def erase(self) -> None:
        """Take the drawing away: the next scene is another table."""
        self._drawing.publish(markers.erasing())

    @staticmethod
    def _begin(message: WrenchStamped, simulation: Simulation, frame: str) -> Prediction:
        shot = shot_from_wrench(message, frame)
        check_at_rest(simulation, "a preview")
        return Prediction(simulation, shot)
