# SPDX-License-Identifier: Apache-2.0
"""The previews that the table owes: one after the other, on a thread of their own, so that nothing waits for them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from queue import Full, Queue

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from billiards_sim.command_line import one_line
from billiards_sim.engine.simulation import Simulation, StallError
from billiards_sim.ros import markers
from billiards_sim.ros.answers import answer, check_at_rest
from billiards_sim.ros.messages import Stamps, stamp_of
from billiards_sim.ros.preview import PIECE, Prediction, Preview, preview_json
from billiards_sim.ros.qos import ANSWER_DEPTH, STATE_DEPTH
from billiards_sim.ros.wrench import shot_from_wrench

MOST_PREVIEWS = 100
"""That wait; more are refused."""


@dataclass(frozen=True)
class Question:
    """A table to play a preview on.

    Attributes:
        simulation: what is on it; a copy, which nobody else uses.
        stamps: of its times.
        frame: of the messages.
        erased: how often drawings had been taken away.
    """

    simulation: Simulation
    stamps: Stamps
    frame: str
    erased: int


class Previews:
    """Takes what people ask on `cue_shot/preview`, answers on `preview/result` and draws on `preview`.

    Args:
        node: of the topics.
        look: what is on the table now; called on the thread of the previews.

    Attributes:
        erased: how often drawings were taken away.
    """

    def __init__(self, node: Node, look: Callable[[], Question]) -> None:
        self._look = look
        self._drawing = node.create_publisher(MarkerArray, "preview", STATE_DEPTH)
        self._results = node.create_publisher(String, "preview/result", ANSWER_DEPTH)
        self._waiting: Queue[WrenchStamped | None] = Queue(MOST_PREVIEWS)
        self._draws = threading.Lock()
        self.erased = 0
        self._stopped = False
        self._thread: threading.Thread | None = None

    def ask(self, message: WrenchStamped, time: float) -> None:
        """Let a shot wait for its turn. At a simulated time, s."""
        try:
            self._waiting.put_nowait(message)
        except Full:
            answer(self._results, message, time, f"{MOST_PREVIEWS} previews wait already")

    def erase(self) -> None:
        """Take the drawing away: the next scene is another table."""
        with self._draws:
            self.erased += 1
            self._drawing.publish(markers.erasing())

    def start(self, fail: Callable[[Exception], object]) -> None:
        """Args:
        fail: told of an exception, on the previews' thread, which then ends.
        """
        self._thread = threading.Thread(target=self._run, args=(fail,), name="previews", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """No answer comes after this."""
        self._stopped = True
        with suppress(Full):  # the thread does not wait then
            self._waiting.put_nowait(None)
        if self._thread is not None:
            self._thread.join()

    def _run(self, fail: Callable[[Exception], object]) -> None:
        try:
            while (message := self._waiting.get()) is not None and not self._stopped:
                self._answer(message)
        except Exception as error:
            fail(error)

    def _answer(self, message: WrenchStamped) -> None:
        question = self._look()
        simulation, preview = question.simulation, None
        try:
            shot = shot_from_wrench(message, question.frame)
            check_at_rest(simulation, "a preview")
            preview = self._played(Prediction(simulation, shot))
        except (ValueError, StallError) as error:
            answer(self._results, message, simulation.time, one_line(error))
        else:
            if preview is None:
                return
            self._results.publish(String(data=preview_json(preview, question.stamps, stamp_of(message))))
        if self._drawing.get_subscription_count() > 0:
            stamp = question.stamps.at(simulation.time)
            drawing = markers.preview_markers(preview, stamp, question.frame)
            with self._draws:
                if self.erased == question.erased:  # else the balls are those of another scene
                    self._drawing.publish(drawing)

    def _played(self, prediction: Prediction) -> Preview | None:
        # None where the node ends meanwhile.
        preview = None
        while preview is None and not self._stopped:
            preview = prediction.go_on(PIECE)
        return preview
