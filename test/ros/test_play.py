# SPDX-License-Identifier: Apache-2.0
"""The page on a running table: what the table says is what the page is told."""

from __future__ import annotations

import asyncio
import json
import signal
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

pytest.importorskip("tornado")

import numpy as np
import rclpy
import tornado.websocket
from conftest import Site
from geometry_msgs.msg import Point, Pose, PoseArray, Twist
from process import Process
from sensor_msgs.msg import MultiDOFJointState

import billiards_sim as bs
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.scene_file import read_scene
from billiards_sim.play.effects import EFFECTS
from billiards_sim.play.ros_backend import GONE, RosBackend, Turning
from billiards_sim.ros.wrench import wrench_from_shot

SHOT = {"speed": 3.0, "azimuth": 0.05, "side": 0.25, "up": 0.3}
"""A break whose offset comes back from a wrench to the bit: another bit is another break."""

PATIENCE = 60.0
"""s that anything may take."""


class Page:
    """A page that is open."""

    def __init__(self, connection: Any) -> None:
        self.connection = connection
        self.told: list[Any] = []
        self._next = 0

    async def read(self) -> Any:
        return json.loads(await asyncio.wait_for(self.connection.read_message(), PATIENCE))

    async def ask(self, **message: Any) -> Any:
        self._next += 1
        await self.connection.write_message(json.dumps({"id": self._next, **message}))
        while (heard := await self.read()).get("id") != self._next:
            self.told.append(heard)
        return heard

    async def until(self, wanted: Callable[[Any], bool]) -> Any:
        """What the page was told at any time, or will be."""
        for heard in self.told:
            if wanted(heard):
                return heard
        while True:
            self.told.append(await self.read())
            if wanted(self.told[-1]):
                return self.told[-1]


def talk(site: Site, about: Callable[[Page], Awaitable[None]], *parameters: str) -> None:
    site.table("scene:=nine_ball", "real_time_factor:=10.0", *parameters)
    talk_on(site, about)


def talk_on(site: Site, about: Callable[[Page], Awaitable[None]]) -> None:
    """With a page on a table that runs."""
    visit(served(site), about)


def served(site: Site) -> Process:
    """The server of a table that runs."""
    play = site.process("play", "--ros", "--no-browser", "--port", "0")
    play.wait_for("(Ctrl-C")
    return play


def visit(play: Process, about: Callable[[Page], Awaitable[None]]) -> None:
    """Open a page, and end its server."""
    address = play.stdout.split()[1].replace("http", "ws") + "socket"

    async def whole() -> None:
        page = Page(await tornado.websocket.websocket_connect(address))
        menu, table = await page.read(), await page.read()
        assert (menu["tell"], menu["live"]) == ("menu", True)
        assert table["table"]["scene"] == "nine_ball"
        await about(page)
        page.connection.close()

    asyncio.run(whole())
    play.signal(2)
    assert play.wait() == 0, play.stderr


def played(shot: dict[str, float], scene: bs.Scene | None = None) -> tuple[bs.Simulation, list[bs.Event]]:
    simulation = bs.Simulation(scene or bs.scenes.nine_ball())
    simulation.shoot(**shot)
    return simulation, list(simulation.run())


def test_a_preview_and_its_shot_are_those_of_the_engine(site: Site) -> None:
    simulation, events = played(SHOT)
    wanted = [at if there else None for at, there in zip(simulation.positions.tolist(), simulation.in_play)]

    async def about(page: Page) -> None:
        centre = bs.scenes.nine_ball().table.centre
        run = (await page.ask(do="preview", shot=SHOT))["run"]
        assert [event["kind"] for event in run["events"]] == [event.kind for event in events]
        for arcs, at in zip(run["arcs"], simulation.positions):
            t, x, y = arcs[-1][:3]
            assert t <= run["end"]
            assert [x + centre[0], y + centre[1]] == pytest.approx(at.tolist(), abs=1e-12)
        assert "error" not in await page.ask(do="shoot", shot=SHOT)
        moving = await page.until(lambda heard: heard.get("tell") == "state" and not heard["at_rest"])
        assert len(moving["balls"]) == 10
        kinds = [event.kind for event in events]
        await page.until(
            lambda heard: heard.get("tell") == "happened" and [one["kind"] for one in heard["run"]["events"]] == kinds
        )

        def ended(heard: Any) -> bool:  # a state that comes between two that are told is told with the next
            if heard.get("tell") != "table":
                return False
            places = [ball["at"] for ball in heard["table"]["balls"]]
            there = [at for at in places if at], [at for at in wanted if at]
            same_balls = [at is None for at in places] == [at is None for at in wanted]
            return same_balls and np.allclose(*there, rtol=0.0, atol=1e-12)

        await page.until(ended)

    talk(site, about)


def test_a_preview_of_balls_that_never_rest_tells_no_rest(site: Site) -> None:
    async def about(page: Page) -> None:
        run = (await page.ask(do="preview", shot=SHOT))["run"]
        assert run["rest"] is None
        assert run["end"] > 0.0

    talk(site, about, "physics.sliding_friction:=0.0", "physics.rolling_friction:=0.0")


def test_balls_are_placed_and_refused_by_the_table_and_reset(site: Site) -> None:
    start = bs.scenes.nine_ball().positions.tolist()

    async def about(page: Page) -> None:
        def there(index: int, wanted: Any) -> Callable[[Any], bool]:
            return lambda heard: (
                heard.get("tell") == "state" and (heard["balls"][index] or [None] * 2)[:2] == (wanted or [None] * 2)
            )

        assert "error" not in await page.ask(do="place", balls={"3": [0.5, 0.5], "4": None})
        state = await page.until(there(3, [0.5, 0.5]))
        assert state["balls"][4] is None
        refused = await page.ask(do="place", balls={"cue": [0.51, 0.5]})
        assert "overlap" in refused["error"]
        page.told.clear()
        assert "error" not in await page.ask(do="reset")
        await page.until(there(3, start[3]))

    talk(site, about)


def lying(index: int, at: Any) -> Callable[[Any], bool]:
    """Whether a page is told of a table on which a ball lies there."""

    def told(heard: Any) -> bool:
        return heard.get("tell") == "table" and heard["table"]["balls"][index]["at"] == at

    return told


def test_shots_and_placements_are_undone_whoever_made_them(site: Site) -> None:
    start = bs.scenes.nine_ball().positions.tolist()

    async def about(page: Page) -> None:
        for _ in range(2):  # what is known without the table, and by its first message
            await page.until(lambda heard: heard.get("tell") == "state")
            page.told.clear()
        assert (await page.ask(do="undo"))["error"] == "there is nothing to undo"
        await page.ask(do="shoot", shot=SHOT)
        await page.until(lambda heard: heard.get("tell") == "table" and heard["table"]["undo"] == 1)
        client = site.client()
        somewhere = [Pose(position=Point(x=0.5 + 0.1 * ball, y=0.6)) for ball in range(10)]
        assert client.place(PoseArray(poses=somewhere))["accepted"]
        await page.until(lambda heard: heard.get("tell") == "table" and heard["table"]["undo"] == 2)
        page.told.clear()
        assert "error" not in await page.ask(do="undo")
        simulation, _ = played(SHOT)
        at = [at if there else None for at, there in zip(simulation.positions.tolist(), simulation.in_play)]
        for index in range(10):
            await page.until(lying(index, at[index]))
        page.told.clear()
        assert "error" not in await page.ask(do="undo")
        await page.until(
            lambda heard: (
                heard.get("tell") == "table"
                and heard["table"]["undo"] == 0
                and [ball["at"] for ball in heard["table"]["balls"]] == start
            )
        )

    talk(site, about)


def test_a_run_that_the_server_slept_through_is_told_and_undone(site: Site) -> None:
    start = bs.scenes.nine_ball().positions.tolist()
    site.table("scene:=nine_ball", "real_time_factor:=50.0")
    play = served(site)

    async def about(page: Page) -> None:
        await page.until(lambda heard: heard.get("tell") == "table" and heard["table"]["link"] is not None)
        client = site.client()
        page.told.clear()
        play.signal(signal.SIGSTOP)
        aim = Aim(**SHOT).shot(bs.Physics.pool())
        assert client.shoot(wrench_from_shot(aim.force, aim.offset))["accepted"]
        client.spin_until(lambda: client.at_rest == [True, False, True])
        client.fresh_state()
        play.signal(signal.SIGCONT)
        await page.until(lambda heard: heard.get("tell") == "state" and not heard["at_rest"])
        await page.until(lambda heard: heard.get("tell") == "table" and heard["table"]["undo"] == 1)
        assert "error" not in await page.ask(do="undo")
        for index in range(10):
            await page.until(lying(index, start[index]))

    visit(play, about)


def test_where_balls_roll_is_nothing_to_go_back_to(site: Site) -> None:
    # That all rest is known before where they lie, by more than any lull.
    site.table("scene:=nine_ball")
    rclpy.init(domain_id=site.domain)
    backend = RosBackend()
    try:
        names, start = backend._scene.names, backend._places

        def places(x: float) -> Any:
            return [[x, 0.5, 0.0, 0.0, 0.0, 1.0], *start[1:]]

        async def hear() -> None:
            backend._take_places(names, places(0.5), True)
            backend._take_rest(False)
            backend._take_places(names, places(0.7), False)
            backend._take_rest(True)
            backend._note()
            backend._take_places(names, places(0.9), True)
            backend._note()

        asyncio.run(hear())
        assert [position["cue"] for position in backend._before] == [(0.5, 0.5)]
    finally:
        backend.close()
        rclpy.shutdown()


def test_a_position_is_saved_and_loaded_on_the_same_table_alone(site: Site) -> None:
    async def about(page: Page) -> None:
        await page.ask(do="place", balls={"3": [0.5, 0.5], "4": None})
        told = await page.until(lying(3, [0.5, 0.5]))
        wanted = bs.scenes.nine_ball().positions.tolist()
        wanted[3] = [0.5, 0.5]
        saved = await page.ask(do="save")
        scene = read_scene(saved["text"])
        assert scene.names[3] == "3"
        assert scene.in_play.tolist() == [ball != 4 for ball in range(10)]
        assert scene.positions[scene.in_play].tolist() == [at for ball, at in enumerate(wanted) if ball != 4]
        assert read_scene(json.dumps(told["table"]["link"])) == scene
        page.told.clear()
        await page.ask(do="reset")
        await page.until(lying(3, bs.scenes.nine_ball().positions[3].tolist()))
        assert "error" not in await page.ask(do="load", text=saved["text"])
        await page.until(lying(3, [0.5, 0.5]))
        await page.until(lying(4, None))
        for text, wanted_error in (
            ("balls: [{name: cue, position: [0.5, 0.5]}]", "the file has another table than the one that runs"),
            ("balls: 3", "balls must be a list"),
        ):
            assert wanted_error in (await page.ask(do="load", text=text))["error"]

    talk(site, about)


def test_a_shot_is_foreseen_with_and_without_an_effect(site: Site) -> None:
    async def about(page: Page) -> None:
        simulation, _ = played(SHOT)
        other, _ = played(SHOT, EFFECTS["ball_friction"].switched(bs.scenes.nine_ball(), False))
        answer = await page.ask(do="preview", shot=SHOT, without="ball_friction")
        assert answer["run"]["end"] == pytest.approx(simulation.time, abs=1e-9)
        assert answer["without"]["end"] == other.time
        assert abs(other.time - simulation.time) > 1e-3

    talk(site, about)


def test_physics_and_speed_are_chosen_at_rest(site: Site) -> None:
    async def about(page: Page) -> None:
        assert "error" not in await page.ask(do="set", physics="paper")
        await page.until(lambda heard: heard.get("tell") == "table" and heard["table"]["physics"] == "paper")
        assert "fixed while the node runs" in (await page.ask(do="set", physics="snooker"))["error"]
        assert "error" not in await page.ask(do="pace", factor=2)
        told = await page.until(lambda heard: heard.get("tell") == "table" and heard["table"]["pace"] == 2.0)
        assert told["table"]["physics"] == "paper"
        assert "real_time_factor" in (await page.ask(do="pace", factor=0))["error"]

    talk(site, about)


def test_what_others_change_is_told(site: Site) -> None:
    async def about(page: Page) -> None:
        client = site.client()
        assert client.set_parameters_atomically(**{"physics.youngs_modulus": 0.0}).successful
        await page.until(
            lambda heard: (
                heard.get("tell") == "table" and not heard["table"]["effects"][list(EFFECTS).index("elastic")]["on"]
            )
        )
        assert client.set_parameters_atomically(scene="eight_ball").successful
        page.told.clear()
        assert client.reset().success
        await page.until(lambda heard: heard.get("tell") == "table" and len(heard["table"]["balls"]) == 16)
        await page.until(lambda heard: heard.get("tell") == "state" and len(heard["balls"]) == 16)

    talk(site, about)


def test_balls_are_turned_by_their_spins() -> None:
    turning = Turning(("cue", "1"))
    state = MultiDOFJointState(joint_names=["1"], twist=[Twist()])
    state.twist[0].angular.y = 25.0 * np.pi
    for tick in range(5):  # 0.04 s, half a turn
        state.header.stamp.sec, state.header.stamp.nanosec = 7, 10_000_000 * tick
        turns = turning.until(state)
    assert turns["cue"] == [0.0, 0.0, 0.0, 1.0]
    assert turns["1"] == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-12)
    state.header.stamp.sec = 90  # nobody has looked since
    assert turning.until(state)["1"] == turns["1"]


def test_an_effect_is_a_parameter_of_the_table(site: Site) -> None:
    async def about(page: Page) -> None:
        assert "error" not in await page.ask(do="effect", effect="elastic", on=False)
        await page.until(
            lambda heard: (
                heard.get("tell") == "table" and not heard["table"]["effects"][list(EFFECTS).index("elastic")]["on"]
            )
        )
        assert "fixed while the node runs" in (await page.ask(do="effect", effect="nose_height", on=False))["error"]
        assert "error" not in await page.ask(do="set", scene="eight_ball")
        await page.until(lambda heard: heard.get("tell") == "table" and len(heard["table"]["balls"]) == 16)

    talk(site, about)


def test_a_page_that_pauses_the_table_goes_on_tick_by_tick(site: Site) -> None:
    async def about(page: Page) -> None:
        assert "error" in await page.ask(do="step")
        assert "error" not in await page.ask(do="pause", on=True)
        assert "error" not in await page.ask(do="shoot", shot=SHOT)
        assert "error" not in await page.ask(do="step")
        assert "error" not in await page.ask(do="step")
        await page.until(lambda heard: heard.get("tell") == "state" and not heard["at_rest"])
        assert "must rest" in (await page.ask(do="shoot", shot=SHOT))["error"]
        assert "error" not in await page.ask(do="pause", on=False)
        await page.until(lambda heard: heard.get("tell") == "happened")

    talk(site, about)


def test_a_table_that_ends_is_told_and_is_shown_again_when_it_runs_again(site: Site) -> None:
    table = site.table("scene:=nine_ball")

    async def about(page: Page) -> None:
        table.signal(2)
        assert table.wait() == 0
        assert (await page.until(lambda heard: heard.get("tell") == "said"))["error"] == GONE
        for asked in ({"do": "preview", "shot": SHOT}, {"do": "reset"}, {"do": "pace", "factor": 2.0}):
            assert (await page.ask(**asked))["error"] == GONE
        site.table("scene:=head_on")
        await page.until(lambda heard: heard.get("tell") == "table" and heard["table"]["scene"] == "head_on")
        assert "error" not in await page.ask(do="reset")

    talk_on(site, about)


def test_without_a_table_it_ends_with_one_line(site: Site) -> None:
    play = site.process("play", "--ros", "--no-browser", "--port", "0")
    assert play.wait() == 1
    assert play.stderr == "play: no table listens on cue_shot within 10 s\n"
