# SPDX-License-Identifier: Apache-2.0
import json
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import Site
from geometry_msgs.msg import WrenchStamped
from process import TIMEOUT, positions
from visualization_msgs.msg import Marker, MarkerArray

import billiards_sim as bs
from billiards_sim.engine import record
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.scene import Shot
from billiards_sim.ros import markers, messages, preview, previews
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import shot_from_wrench, wrench_from_shot

BREAK = Shot((125.0, 6.0, 0.0), (0.004, -0.002))
RADIUS = bs.Physics().radius


def table(**changes: float) -> bs.Simulation:
    simulation = bs.Simulation(bs.scenes.rack(physics=bs.Physics(**changes)))
    simulation.advance(1.5)
    return simulation


def test_a_preview_is_what_the_shot_does_and_changes_nothing() -> None:
    simulation = table()
    before = simulation.positions
    found = preview.predict(simulation, BREAK)
    assert np.array_equal(simulation.positions, before)
    assert (simulation.time, simulation.at_rest) == (1.5, True)
    simulation.strike(BREAK.force, BREAK.offset)
    events = list(simulation.run())
    assert list(found.events) == events
    assert [*found.final_positions.values()] == [tuple(row) for row in simulation.positions.tolist()]
    assert (found.start, found.end, found.complete) == (1.5, events[-1].time, True)


def test_a_preview_lasts_until_the_last_spin_has_ended() -> None:
    # Squarely into a ball the cue ball stops with its side, which ends after the other has rolled out.
    simulation = bs.Simulation(bs.Scene([[0.5, 0.6], [0.6, 0.6]], physics=bs.Physics.pool(spin_friction=0.004)))
    shot = Aim(0.6, 0.0, side=0.4).shot(simulation.start_scene.physics)
    found = preview.predict(simulation, shot)
    simulation.strike(shot.force, shot.offset)
    events = list(simulation.run())
    assert list(found.events) == events
    assert found.complete
    assert found.end == pytest.approx(simulation.time, abs=1e-12)
    assert found.end > events[-1].time + 0.1
    assert [*found.final_positions.values()] == [tuple(row) for row in simulation.positions.tolist()]


def test_a_preview_of_a_raised_shot_on_a_pool_table_is_the_shot(make_node: Callable[..., TableNode]) -> None:
    node = make_node("physics.preset:=pool")
    node.start()
    shot = Aim(6.0, 0.02, side=0.3, up=-0.2, elevation=0.2).shot(node.settings.scene.physics)
    message = wrench_from_shot(shot.force, shot.offset)
    found = preview.predict(node.simulation, shot_from_wrench(message, "table"))
    node._on_cue_shot(message)
    assert list(found.events) == list(node.simulation.run())
    assert len(found.events) > 50
    assert [*found.final_positions.values()] == [tuple(row) for row in node.simulation.positions.tolist()]
    assert found.end == pytest.approx(node.simulation.time, abs=1e-12)


def test_paths_pass_through_every_contact() -> None:
    simulation = table()
    found = preview.predict(simulation, BREAK)
    for event in found.events:
        if event.kind not in ("ball_ball", "ball_rail"):
            continue
        for name in event.balls:
            path = np.array(found.paths[name])[:, 1:]
            gaps = np.hypot(*(path - event.point).T)
            assert np.abs(gaps - RADIUS).min() < 1e-9
    assert tuple(found.paths) == simulation.start_scene.names
    for (name, path), start in zip(found.paths.items(), simulation.positions.tolist()):
        assert path[0] == (1.5, *start)
        assert [t for t, _, _ in path] == sorted(t for t, _, _ in path)
        moved = any(name in event.balls for event in found.events)
        assert (len(path) > 1) is moved


def test_paths_tell_where_a_ball_is_at_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    # A fast cue ball with draw slides on along a parabola after a thin hit.
    simulation = bs.Simulation(bs.Scene([[0.5, 0.6], [0.9, 0.63]]))
    shot = Shot((60.0, 0.0, 0.0), (0.0, -0.014))

    def worst() -> float:
        t, x, y = np.array(preview.predict(simulation, shot).paths["cue"]).T
        twin = simulation.copy()
        twin.strike(shot.force, shot.offset)
        away = []
        while not twin.at_rest:
            twin.advance(0.01)
            drawn = (np.interp(twin.time, t, x), np.interp(twin.time, t, y))
            away.append(float(np.hypot(*(twin.positions[0] - drawn))))
        return max(away)

    assert worst() < record.CHORD * (1.0 + 1e-9)
    monkeypatch.setattr(record, "CHORD", 10.0)
    assert worst() > 0.008


def test_a_path_begins_where_the_ball_lay_before_the_cue_pushed_it() -> None:
    simulation = bs.Simulation(bs.Scene([[0.5, 0.6]]))
    path = preview.predict(simulation, Shot((80.0, 0.0, 0.0))).paths["cue"]
    # s = F t^2 / (2 m)
    assert np.array(path[:2]) == pytest.approx(np.array([[0.0, 0.5, 0.6], [0.0, 0.5 + 0.5 * 80.0 / 0.16 * 1e-4, 0.6]]))


def test_a_table_without_friction_ends_at_the_horizon() -> None:
    found = preview.predict(table(rolling_friction=0.0, rail_restitution=1.0), BREAK)
    assert found.complete is False
    assert found.end - found.start <= preview.HORIZON + 1e-9
    slow = preview.predict(table(rolling_friction=0.0), Shot((0.16, 0.0, 0.0)))
    assert slow.end - slow.start == pytest.approx(preview.HORIZON)


def test_events_end_a_preview(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preview, "MOST_EVENTS", 20)
    found = preview.predict(table(), BREAK)
    assert found.complete is False
    assert 20 <= len(found.events) < 130


def simulated_rest(simulation: bs.Simulation) -> list[list[float]]:
    """Where the balls come to rest after the break."""
    simulation.strike(BREAK.force, BREAK.offset)
    simulation.run()
    return simulation.positions.tolist()


def test_preview_json_keeps_every_digit() -> None:
    simulation = table()
    found = preview.predict(simulation, BREAK)
    names = simulation.start_scene.names
    stamps = messages.Stamps(1_000_000_000)
    read = json.loads(preview.preview_json(found, stamps, (7, 8)))
    assert {key: read[key] for key in ("version", "accepted", "reason", "time", "complete")} == {
        "version": 2,
        "accepted": True,
        "reason": "",
        "time": 1.5,
        "complete": True,
    }
    assert read["request"] == {"sec": 7, "nanosec": 8}
    assert read["duration"] == found.end - 1.5
    assert read["names"] == list(names)
    assert read["paths"] == {name: [list(point) for point in path] for name, path in found.paths.items()}
    assert read["paths"]["cue"][0] == [1.5, *simulation.positions[0]]
    assert [path[-1][1:] for path in read["paths"].values()] == simulated_rest(simulation)
    assert read["final_positions"] == {name: list(place) for name, place in found.final_positions.items()}
    assert [event["kind"] for event in read["events"]] == [event.kind for event in found.events]
    assert [event["time"] for event in read["events"]] == [event.time for event in found.events]
    assert read["events"][0]["stamp"] == {"sec": 2, "nanosec": 500_000_000}


def test_markers_draw_paths_contacts_and_final_positions() -> None:
    simulation = bs.Simulation(bs.Scene([[0.5, 0.5], [1.0, 0.5], [1.0, 1.0]]))
    found = preview.predict(simulation, Shot((30.0, 0.0, 0.0)))
    first, *others = markers.preview_markers(found, 1_500_000_000, "table").markers
    assert first.action == Marker.DELETEALL
    by_id = {(marker.ns, marker.id): marker for marker in others}
    assert set(by_id) == {
        ("preview_paths", 0),
        ("preview_paths", 1),
        ("preview_contacts", 0),
        ("preview_balls", 0),
        ("preview_balls", 1),
    }
    assert len(by_id) == len(others)
    assert all((one.action, one.header.frame_id, one.header.stamp.sec) == (Marker.ADD, "table", 1) for one in others)
    line = by_id["preview_paths", 1]
    assert (line.type, line.scale.x > 0.0) == (Marker.LINE_STRIP, True)
    assert [(p.x, p.y, p.z) for p in line.points] == [(x, y, RADIUS) for _, x, y in found.paths["1"]]
    contacts = by_id["preview_contacts", 0]
    hits = [event.point for event in found.events if event.kind in ("ball_ball", "ball_rail")]
    assert contacts.type == Marker.SPHERE_LIST
    assert [(p.x, p.y) for p in contacts.points] == hits
    for index, name in enumerate(("cue", "1")):
        place = found.final_positions[name]
        ball = by_id["preview_balls", index]
        assert (ball.pose.position.x, ball.pose.position.y) == place
        assert 0.0 < ball.color.a < 1.0
    assert [one.action for one in markers.preview_markers(None, 0, "table").markers] == [Marker.DELETEALL]


def test_the_table_answers_and_then_plays_what_it_said(site: Site) -> None:
    site.table("scene:=rack", "real_time_factor:=10.0")
    client = site.client()
    message = wrench_from_shot(BREAK.force, BREAK.offset)
    message.header.stamp.sec, message.header.stamp.nanosec = 12, 34
    answer = client.preview(message)
    assert (answer["accepted"], answer["complete"], answer["request"]) == (True, True, {"sec": 12, "nanosec": 34})
    client.spin_until(lambda: client.drawings)
    assert {marker.ns for marker in client.drawings[0].markers if marker.ns} == {
        "preview_paths",
        "preview_contacts",
        "preview_balls",
    }
    assert positions(client.fresh_poses()[0]) == [tuple(row) for row in bs.scenes.rack().positions.tolist()]
    assert (client.collisions, client.results, client.at_rest) == ([], [], [True])

    off = client.preview(wrench_from_shot((80.0, 0.0, 0.0), (0.03, 0.0)))
    assert off["accepted"] is False
    assert "offset must lie on the ball" in off["reason"]
    client.spin_until(lambda: len(client.drawings) == 2)
    assert len(client.drawings[1].markers) == 1  # takes the last preview away

    assert client.shoot(wrench_from_shot(BREAK.force, BREAK.offset))["accepted"]
    moving = client.preview(message)
    assert "every ball must rest before a preview" in moving["reason"]
    client.spin_until(lambda: client.at_rest[-1] and len(client.collisions) >= len(answer["events"]))
    assert told(client.collisions) == told(answer["events"])
    assert positions(client.fresh_poses(2)[-1]) == [tuple(place) for place in answer["final_positions"].values()]


def told(events: list[dict]) -> list[dict]:
    """Of each event what does not depend on when the shot was made."""
    return [{key: value for key, value in event.items() if key not in ("time", "stamp")} for event in events]


WAITS = {0.0: (100.0, 1.0, 0), 0.1: (100.0, 10.0, 1), 1e3: (1.0, 1000.0, 1), 1e6: (0.1, 1000.0, 100)}
"""By the table's time, s: a rate, a real-time factor, and how many steps of a paused table lead there."""


def test_a_shot_has_the_same_bits_as_its_preview_and_at_any_time_of_the_table(site: Site) -> None:
    site.table("scene:=rack")
    client = site.client()
    message = wrench_from_shot(BREAK.force, BREAK.offset)
    ends, events = [], []
    for wait, (rate, factor, steps) in WAITS.items():
        client.pause(True)
        client.reset()
        assert client.set_parameters_atomically(update_rate=rate, real_time_factor=factor).successful
        for _ in range(steps):
            client.step()
        assert client.set_parameters_atomically(update_rate=100.0, real_time_factor=20.0).successful
        answer = client.preview(message)
        assert answer["time"] == pytest.approx(wait, rel=1e-12)
        client.collisions.clear()
        verdict = client.shoot(message)
        assert (verdict["accepted"], verdict["time"]) == (True, answer["time"])
        client.pause(False)
        client.spin_until(lambda: client.at_rest[-1] and len(client.collisions) >= len(answer["events"]))  # noqa: B023
        assert told(client.collisions) == told(answer["events"])
        assert [one["time"] for one in client.collisions] == [one["time"] for one in answer["events"]]
        ends.append(positions(client.fresh_poses(2)[-1]))
        assert ends[-1] == [tuple(place) for place in answer["final_positions"].values()]
        events.append(told(client.collisions))
    assert ends[1:] == ends[:1] * 3
    assert events[1:] == events[:1] * 3


def test_previews_wait_for_no_tick(site: Site) -> None:
    site.table("scene:=rack")
    client = site.client()
    assert client.set_parameters_atomically(update_rate=0.5).successful
    client.fresh_poses()
    client.poses.clear()
    for number in range(10):
        assert client.preview(asked(number))["accepted"]
    assert len(client.poses) < 9  # as many ticks as previews, if they waited


class Answers:
    """Holds up the first preview of a node, and keeps what the node says."""

    def __init__(self, node: TableNode, monkeypatch: pytest.MonkeyPatch) -> None:
        self.begun, self.go_on = threading.Event(), threading.Event()
        self.refused: list[tuple[int, str]] = []
        self.answered: list[int] = []
        self.failures: list[Exception] = []
        play = preview.Prediction.go_on

        def held_up(prediction: preview.Prediction, budget: float) -> preview.Preview | None:
            self.begun.set()
            assert self.go_on.wait(TIMEOUT)
            return play(prediction, budget)

        def refuse(_: object, request: WrenchStamped, time: float, reason: str) -> None:
            self.refused.append((request.header.stamp.sec, reason))

        def answer(found: preview.Preview, stamps: messages.Stamps, request: tuple[int, int]) -> str:
            self.answered.append(request[0])
            return ""

        monkeypatch.setattr(preview.Prediction, "go_on", held_up)
        monkeypatch.setattr(previews, "answer", refuse)
        monkeypatch.setattr(previews, "preview_json", answer)
        node.previews.start(self.failures.append)

    def until(self, done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not done():
            assert time.monotonic() < deadline
            time.sleep(0.01)


@pytest.fixture
def answers(table: TableNode, monkeypatch: pytest.MonkeyPatch) -> Iterator[Answers]:
    answers = Answers(table, monkeypatch)
    yield answers
    answers.go_on.set()
    table.previews.stop()
    assert answers.failures == []


def asked(number: int) -> WrenchStamped:
    message = wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0))
    message.header.stamp.sec = number
    return message


def test_a_preview_that_takes_long_holds_up_neither_ticks_nor_shots(table: TableNode, answers: Answers) -> None:
    table._on_preview(asked(1))
    assert answers.begun.wait(TIMEOUT)
    before = table.simulation.time
    table._on_beat()
    table._on_cue_shot(wrench_from_shot(BREAK.force, BREAK.offset))
    table._on_beat()
    assert table.simulation.time > before
    assert not table.simulation.at_rest
    assert answers.answered == []
    answers.go_on.set()
    answers.until(lambda: answers.answered == [1])  # of the table as it was
    assert answers.refused == []


def test_too_many_previews_at_once_are_refused_and_the_others_are_answered_in_order(
    table: TableNode, answers: Answers
) -> None:
    table._on_preview(asked(0))
    assert answers.begun.wait(TIMEOUT)
    for number in range(1, 103):
        table._on_preview(asked(number))
    assert answers.refused == [(number, "100 previews wait already") for number in (101, 102)]
    answers.go_on.set()
    answers.until(lambda: len(answers.answered) == 101)
    assert answers.answered == list(range(101))


def test_the_end_of_the_node_ends_a_preview(
    table: TableNode, answers: Answers, monkeypatch: pytest.MonkeyPatch
) -> None:
    pieces: list[float] = []

    def without_end(_: preview.Prediction, budget: float) -> None:
        assert len(pieces) < 10_000
        pieces.append(budget)
        time.sleep(0.001)

    monkeypatch.setattr(preview.Prediction, "go_on", without_end)
    for number in range(3):
        table._on_preview(asked(number))
    answers.until(lambda: len(pieces) > 3)
    table.previews.stop()
    assert len(pieces) < 10_000
    assert (answers.answered, answers.refused) == ([], [])


@pytest.fixture
def drawn(table: TableNode) -> list[int]:
    """Of each drawing that goes out how many markers it has; what takes the last one away has one."""
    drawn: list[int] = []
    table.previews._drawing = SimpleNamespace(
        publish=lambda message: drawn.append(len(message.markers)), get_subscription_count=lambda: 1
    )
    return drawn


def test_a_preview_of_the_table_before_a_new_scene_is_not_drawn(
    table: TableNode, answers: Answers, drawn: list[int]
) -> None:
    table._on_preview(asked(1))
    assert answers.begun.wait(TIMEOUT)
    table.previews.erase()
    table._on_preview(asked(2))
    answers.go_on.set()
    answers.until(lambda: len(answers.answered) == 2 and len(drawn) == 2)
    assert drawn[0] == 1  # the eraser


def test_a_drawing_that_is_made_while_the_scene_changes_is_not_shown(
    table: TableNode, answers: Answers, drawn: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    make = markers.preview_markers

    def make_meanwhile(*given: Any) -> MarkerArray:
        table.previews.erase()
        return make(*given)

    monkeypatch.setattr(markers, "preview_markers", make_meanwhile)
    answers.go_on.set()
    table._on_preview(asked(1))
    answers.until(lambda: answers.answered == [1])
    table.previews.stop()
    assert drawn == [1]


def test_a_preview_that_waited_while_the_scene_changed_is_drawn(
    table: TableNode, answers: Answers, drawn: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    look = table.previews._look

    def look_after_it() -> previews.Question:
        table.previews.erase()
        return look()

    monkeypatch.setattr(table.previews, "_look", look_after_it)
    answers.go_on.set()
    table._on_preview(asked(1))
    answers.until(lambda: answers.answered == [1])
    table.previews.stop()
    assert drawn[0] == 1
    assert len(drawn) == 2


def test_a_preview_in_pieces_is_the_preview_in_one(table: TableNode) -> None:
    prediction, count = preview.Prediction(table.simulation, BREAK), 0
    while (found := prediction.go_on(1e-9)) is None:
        count += 1
    whole = preview.predict(table.simulation, BREAK)
    assert (found.events, found.paths, found.end) == (whole.events, whole.paths, whole.end)
    assert count > 3
