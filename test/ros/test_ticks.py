# SPDX-License-Identifier: Apache-2.0
"""What happens at a tick and between two, with the node in this process."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from contextlib import nullcontext

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseArray, Transform, Vector3, VelocityStamped
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

import billiards_sim as bs
from billiards_sim.ros import event_queue, state_publisher, table_node
from billiards_sim.ros.markers import BallMarkers
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot


@pytest.mark.parametrize(
    ("update_rate", "marker_rate", "drawn"), [(100.0, 30.0, 30), (50.0, 50.0, 100), (10.0, 30.0, 100), (100.0, 0.0, 0)]
)
def test_markers_come_at_their_own_rate(
    table: TableNode, monkeypatch: pytest.MonkeyPatch, update_rate: float, marker_rate: float, drawn: int
) -> None:
    rates = [rclpy.Parameter("update_rate", value=update_rate), rclpy.Parameter("marker_rate", value=marker_rate)]
    assert table.set_parameters_atomically(rates).successful
    drawn_at = []
    monkeypatch.setattr(state_publisher, "_heard", lambda _: True)
    monkeypatch.setattr(
        BallMarkers, "update", lambda _, positions, stamp, turned, in_play: drawn_at.append(stamp) or MarkerArray()
    )
    for _ in range(100):
        table._on_beat()
    assert abs(len(drawn_at) - drawn) <= 1


def test_what_the_executor_calls_waits_for_a_tick(table: TableNode, monkeypatch: pytest.MonkeyPatch) -> None:
    shot = threading.Thread(target=table._on_reset, args=(None, Trigger.Response()))
    seen = []

    def advance(_: float) -> None:
        shot.start()
        shot.join(timeout=0.2)
        seen.append(shot.is_alive())

    monkeypatch.setattr(table, "advance", advance)
    with table.lock:
        table._on_beat()
    shot.join()
    assert seen == [True]


def test_a_tick_between_the_check_and_the_change_of_parameters_does_not_turn_time_back(table: TableNode) -> None:
    assert table._on_set_parameters([rclpy.Parameter("physics.mass", value=0.2)]).successful
    table.advance(0.25)
    table._on_parameters_set([])
    assert table.settings.scene.physics.mass == 0.2
    assert table.simulation.time == 0.25


def test_an_error_in_a_tick_ends_the_node(make_node: Callable[..., TableNode], monkeypatch: pytest.MonkeyPatch) -> None:
    node = make_node()

    def advance(_: float) -> None:
        raise ZeroDivisionError("in a tick")

    monkeypatch.setattr(node, "advance", advance)
    monkeypatch.setattr(table_node, "stoppable", nullcontext)
    with pytest.raises(RuntimeError, match="a tick failed") as caught:
        table_node._serve(node)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


def test_refusals_of_one_kind_are_logged_once_a_period(
    table: TableNode, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    now = [100.0]
    monkeypatch.setattr(table_node.time, "monotonic", lambda: now[0])
    for passed in (0.0, 0.5, 0.4, 0.2):
        now[0] += passed
        table._on_cue_shot(wrench_from_shot((0.0, 0.0, 0.0), (0.0, 0.0)))
        table._on_place_balls(PoseArray())
    log = capfd.readouterr().err
    assert log.count("shot refused: ") == 2
    assert log.count("placement refused: ") == 2


class Recorder:
    """A publisher with a subscriber, which keeps what goes out."""

    def __init__(self, sent: list[str], name: str) -> None:
        self._sent = sent
        self._name = name

    def get_subscription_count(self) -> int:
        return 1

    def publish(self, message: String | Bool) -> None:
        if self._name == "event":
            self._sent += [event["kind"] for event in json.loads(message.data)["events"]]
        else:
            self._sent.append(f"at_rest {message.data}")


@pytest.fixture
def sent(table: TableNode, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Events and rest as they go out, no more than two events at a tick."""
    sent: list[str] = []
    monkeypatch.setattr(event_queue, "EVENTS_A_TICK", 2)
    monkeypatch.setattr(table._publisher, "_collisions_publisher", Recorder(sent, "event"))
    monkeypatch.setattr(table._publisher, "_at_rest_publisher", Recorder(sent, "rest"))
    return sent


def test_many_events_are_spread_over_ticks_and_rest_comes_after_them(table: TableNode, sent: list[str]) -> None:
    simulation = table.simulation.copy()
    simulation.strike((1.0, 0.0, 0.0))
    kinds = [event.kind for event in simulation.run()]
    assert kinds == ["shot", "rolling", "rest"]
    table._on_cue_shot(wrench_from_shot((1.0, 0.0, 0.0), (0.0, 0.0)))
    table.advance(60.0)
    assert sent == ["at_rest False", *kinds[:2]]
    table.advance(0.01)
    assert sent == ["at_rest False", *kinds, "at_rest True"]


def test_a_reset_publishes_no_flood_and_forgets_no_event(table: TableNode, sent: list[str]) -> None:
    table._on_cue_shot(wrench_from_shot((1.0, 0.0, 0.0), (0.0, 0.0)))
    table.advance(60.0)
    table.reset()
    assert sent == ["at_rest False", "shot", "rolling"]
    table.advance(0.01)
    assert sent == ["at_rest False", "shot", "rolling", "rest", "at_rest True"]


def test_events_that_are_dropped_are_told_in_the_log(
    table: TableNode, sent: list[str], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(event_queue, "MOST_WAITING", 2)
    table._on_cue_shot(wrench_from_shot((1.0, 0.0, 0.0), (0.0, 0.0)))
    table.advance(60.0)
    table._on_beat()
    table._on_beat()
    assert sent == ["at_rest False", "rest", "at_rest True"]
    assert capfd.readouterr().err.count("2 events dropped: more than") == 1


class Ears:
    """A publisher with a subscriber, which keeps the names of the balls whose twists go out."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def get_subscription_count(self) -> int:
        return 1

    def publish(self, message: bytes) -> None:
        self.names.append(deserialize_message(message, VelocityStamped).body_frame_id)


@pytest.mark.parametrize("update_rate", [100.0, 1.0, 0.1])
def test_twists_of_resting_balls_come_again_once_a_second_in_turns(
    table: TableNode, monkeypatch: pytest.MonkeyPatch, update_rate: float
) -> None:
    assert table.set_parameters_atomically([rclpy.Parameter("update_rate", value=update_rate)]).successful
    ears = Ears()
    monkeypatch.setattr(table._publisher, "_twists_publisher", ears)
    names = list(bs.scenes.rack().names)
    table.advance(0.01)
    assert ears.names == names  # of a new table
    ticks = max(round(update_rate), 1)
    for _ in range(2):
        ears.names.clear()
        most = 0
        for _ in range(ticks):
            before = len(ears.names)
            table.advance(0.01)
            most = max(most, len(ears.names) - before)
        assert sorted(ears.names) == sorted(names)
        assert most == (1 if ticks >= len(names) else len(names))


def test_twists_of_a_ball_come_every_tick_while_it_moves_and_once_when_it_rests(
    table: TableNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    ears = Ears()
    monkeypatch.setattr(table._publisher, "_twists_publisher", ears)
    monkeypatch.setattr(table._publisher._forms, "turns", np.full(16, -1))  # nobody's turn
    table.advance(0.01)
    ears.names.clear()
    table.simulation.strike((1.0, 0.0, 0.0))
    moving = 0
    while not table.simulation.at_rest:
        table.advance(0.01)
        moving += 1
    table.advance(0.01)
    table.advance(0.01)
    assert ears.names == ["cue"] * moving  # the last with velocity 0


def test_a_ball_off_the_table_has_no_twist(table: TableNode, monkeypatch: pytest.MonkeyPatch) -> None:
    ears = Ears()
    monkeypatch.setattr(table._publisher, "_twists_publisher", ears)
    transforms = [Transform(translation=Vector3(x=x, y=0.5)) for x in (0.5, 1.5)]
    table._on_set_balls(MultiDOFJointState(joint_names=["cue", "9"], transforms=transforms))
    ears.names.clear()
    for _ in range(101):
        table.advance(0.01)
    assert sorted(set(ears.names)) == ["9", "cue"]
    ears.names.clear()
    table._on_cue_shot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))
    while not table.simulation.at_rest:
        table.advance(0.01)
    assert sorted(set(ears.names)) == ["9", "cue"]
