# SPDX-License-Identifier: Apache-2.0
"""What a page asks for and is told, without a browser: over a real socket, against the engine."""

from __future__ import annotations

import asyncio
import dataclasses
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest

pytest.importorskip("tornado")

import tornado.httpclient
import tornado.httpserver
import tornado.websocket

import billiards_sim as bs
from billiards_sim.command_line import Refusal
from billiards_sim.engine import simulation as simulation_module
from billiards_sim.play import engine_backend, server
from billiards_sim.play.effects import EFFECTS
from billiards_sim.play.engine_backend import EngineBackend
from billiards_sim.play.records import SHORT, link_document

BREAK = {"speed": 8.0, "azimuth": 0.01, "side": 0.1, "up": 0.2}
Talk = Callable[["Table"], Awaitable[None]]


class Page:
    """A page that is open."""

    def __init__(self, connection: tornado.websocket.WebSocketClientConnection) -> None:
        self.connection = connection
        self.told: list[Any] = []
        self._next = 0

    async def read(self) -> Any:
        message = await asyncio.wait_for(self.connection.read_message(), 20.0)
        return None if message is None else json.loads(message)

    async def send(self, text: str | bytes) -> None:
        await self.connection.write_message(text, isinstance(text, bytes))

    async def ask(self, **message: Any) -> Any:
        """The answer; what was told before it is in `told`."""
        self._next += 1
        await self.send(json.dumps({"id": self._next, **message}))
        return await self.answer(self._next)

    async def answer(self, identity: int | None) -> Any:
        while True:
            heard = await self.read()
            if "tell" not in heard and heard.get("id") == identity:
                return heard
            self.told.append(heard)

    async def table(self) -> Any:
        """What the next change makes of the table."""
        while True:
            heard = self.told.pop(0) if self.told else await self.read()
            if heard.get("tell") == "table":
                return heard


class Table:
    """A server, and pages of it."""

    def __init__(self, scene: bs.Scene) -> None:
        self.backend = EngineBackend(scene)
        self.server, self.port = server.serve(self.backend, 0)
        self.pages: list[Page] = []

    async def page(self, *, greeted: bool = True, **headers: str) -> Page:
        request = tornado.httpclient.HTTPRequest(f"ws://127.0.0.1:{self.port}/socket", headers=headers)
        page = Page(await tornado.websocket.websocket_connect(request, max_message_size=10_000_000))
        self.pages.append(page)
        if greeted:
            menu, table = await page.read(), await page.read()
            assert (menu["tell"], table["tell"]) == ("menu", "table")
        return page

    async def get(self, path: str, **headers: str) -> tornado.httpclient.HTTPResponse:
        client = tornado.httpclient.AsyncHTTPClient()
        return await client.fetch(f"http://127.0.0.1:{self.port}{path}", headers=headers, raise_error=False)

    async def close(self) -> None:
        for page in self.pages:
            page.connection.close()
        self.server.stop()
        await self.server.close_all_connections()


@asynccontextmanager
async def serving(scene: bs.Scene) -> AsyncIterator[Table]:
    table = Table(scene)
    try:
        yield table
    finally:
        await table.close()


def talk(about: Talk, scene: bs.Scene | None = None) -> None:
    async def whole() -> None:
        async with serving(scene or bs.scenes.eight_ball()) as table:
            await about(table)

    asyncio.run(asyncio.wait_for(whole(), 100.0))


def shot_in_the_engine(scene: bs.Scene, shot: dict[str, float]) -> tuple[bs.Simulation, Any]:
    simulation = bs.Simulation(scene)
    simulation.shoot(**shot)
    return simulation, bs.record(simulation)


def ends(run: Any, centre: Any) -> Any:
    """Where the arcs of a run lead, by the formula that docs/play.md gives."""
    found = []
    for arcs in run["arcs"]:
        if not arcs:
            found.append(None)
            continue
        t, x, y, vx, vy, ax, ay = arcs[-1][:7]
        age = run["end"] - t
        found.append([x + (vx + 0.5 * ax * age) * age + centre[0], y + (vy + 0.5 * ay * age) * age + centre[1]])
    return found


def same_events(told: list[Any], events: Any) -> bool:
    wanted = [{k: v for k, v in dataclasses.asdict(event).items() if v is not None} for event in events]
    return bool(told == json.loads(json.dumps(wanted)))


def test_a_preview_has_the_bits_of_the_engine_and_changes_nothing() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        scene = table.backend.scene
        answer = await page.ask(do="preview", shot=BREAK)
        simulation, run = shot_in_the_engine(scene, BREAK)
        assert answer["run"]["end"] == simulation.time
        assert ends(answer["run"], scene.table.centre) == simulation.positions.tolist()
        assert same_events(answer["run"]["events"], run.events)
        assert len(run.events) > 50
        assert table.backend.scene is scene
        for name, arcs in zip(scene.names, answer["run"]["arcs"]):
            whole = run.arcs(name)[:, :7].tolist()
            assert all(arc in whole for arc in arcs)
            times = [arc[0] for arc in arcs]
            left_out = [arc for arc in whole if arc not in arcs]
            assert all(any(0.0 <= arc[0] - t <= SHORT for t in times) for arc in left_out)

    talk(about)


def test_a_shot_does_what_its_preview_said_and_every_page_sees_it() -> None:
    async def about(table: Table) -> None:
        page, other = await table.page(), await table.page()
        scene = table.backend.scene
        foreseen = (await page.ask(do="preview", shot=BREAK))["run"]
        assert "error" not in await page.ask(do="shoot", shot=BREAK)
        _, run = shot_in_the_engine(scene, BREAK)
        for told in (await page.table(), await other.table()):
            assert told["run"]["arcs"] == [run.arcs(name).tolist() for name in scene.names]
            assert told["run"]["end"] == foreseen["end"]
            assert told["run"]["events"] == foreseen["events"]
            fallen = {event["balls"][0] for event in told["run"]["events"] if event["kind"] == "pocketed"}
            rest = zip(scene.names, ends(told["run"], scene.table.centre))
            wanted = [None if name in fallen else at for name, at in rest]
            assert [ball["at"] for ball in told["table"]["balls"]] == wanted
            assert fallen
            assert told["table"]["undo"] == 1

    talk(about)


def test_the_next_shot_begins_where_the_last_one_ended() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        await page.ask(do="shoot", shot=BREAK)
        after = (await page.table())["table"]
        second = {"speed": 2.0, "azimuth": 1.0}
        answer = await page.ask(do="preview", shot=second)
        simulation, _ = shot_in_the_engine(table.backend.scene, second)
        rest = zip(simulation.positions.tolist(), simulation.in_play)
        assert ends(answer["run"], after["centre"]) == [at if there else None for at, there in rest]

    talk(about)


def test_undo_goes_back_step_by_step_to_the_same_bits() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        start = table.backend.scene
        await page.ask(do="shoot", shot=BREAK)
        broken = table.backend.scene
        assert "error" not in await page.ask(do="place", balls={"1": [1.0, 0.6]})
        assert "error" not in await page.ask(do="undo")
        assert table.backend.scene == broken
        assert "error" not in await page.ask(do="undo")
        assert table.backend.scene == start
        assert (await page.ask(do="undo"))["error"] == "there is nothing to undo"
        assert table.backend.scene == start

    talk(about)


def test_reset_puts_the_game_back_as_it_began() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        await page.ask(do="set", scene="nine_ball")
        start = table.backend.scene
        assert start == dataclasses.replace(bs.scenes.nine_ball(), shot=None)
        await page.ask(do="shoot", shot=BREAK)
        await page.ask(do="reset")
        assert table.backend.scene == start

    talk(about)


def test_balls_are_placed_taken_off_and_put_back() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        await page.ask(do="place", balls={"8": None, "1": [0.5, 0.5]})
        told = {ball["name"]: ball["at"] for ball in (await page.table())["table"]["balls"]}
        assert told["8"] is None
        assert told["1"] == [0.5, 0.5]
        run = (await page.ask(do="preview", shot=BREAK))["run"]
        assert run["arcs"][run["names"].index("8")] == []
        await page.ask(do="place", balls={"8": [1.0, 0.5]})
        scene = table.backend.scene
        assert scene.in_play.all()
        assert scene.positions[scene.names.index("8")].tolist() == [1.0, 0.5]

    talk(about)


def test_what_the_engine_refuses_is_refused_in_its_words() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        scene = table.backend.scene
        at = scene.positions[scene.names.index("1")].tolist()
        answer = await page.ask(do="place", balls={"cue": [at[0] + 0.01, at[1]]})
        assert answer["error"].startswith("balls 'cue' and '1' overlap by 0.04715")
        assert "into the rail x_min" in (await page.ask(do="place", balls={"cue": [0.14, 0.7]}))["error"]
        answer = await page.ask(do="shoot", shot={**BREAK, "up": 0.7})
        assert "the miscue limit is 0.5 radii" in answer["error"]
        assert table.backend.scene is scene

    talk(about)


@pytest.mark.parametrize("key", list(EFFECTS))
def test_a_shot_is_foreseen_with_and_without_an_effect(key: str) -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        scene = table.backend.scene
        without = EFFECTS[key].switched(scene, False)
        shot = {"speed": 4.0, "azimuth": 0.7, "side": 0.4, "up": 0.1}
        answer = await page.ask(do="preview", shot=shot, without=key)
        for run, wanted in ((answer["run"], scene), (answer["without"], without)):
            simulation, _ = shot_in_the_engine(wanted, shot)
            assert ends(run, scene.table.centre) == simulation.positions.tolist()
        assert await page.ask(do="effect", effect=key, on=False) == {"id": 2}
        told = {effect["key"]: effect["on"] for effect in (await page.table())["table"]["effects"]}
        assert told == {other: other != key for other in EFFECTS}
        assert table.backend.scene == without
        await page.ask(do="effect", effect=key, on=True)
        assert table.backend.scene == scene  # whose figures are those of pool

    talk(about)


def test_effects_that_change_the_shot_change_its_preview() -> None:
    scene = bs.scenes.eight_ball()
    shot = {"speed": 4.0, "azimuth": 0.12, "side": 0.4, "up": 0.1}
    with_all, _ = shot_in_the_engine(scene, shot)
    for key in EFFECTS:
        without, _ = shot_in_the_engine(EFFECTS[key].switched(scene, False), shot)
        assert not np.array_equal(without.positions, with_all.positions), key


def test_a_figure_out_of_bounds_is_refused() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        answer = await page.ask(do="effect", effect="rail_friction", on=True, value=1.5)
        assert answer["error"] == "physics.rail_friction must be a number >= 0, <= 1 (1), got 1.5"
        await page.ask(do="effect", effect="rail_friction", on=True, value=0.3)
        assert table.backend.scene.physics.rail_friction == 0.3

    talk(about)


def test_a_link_and_a_saved_file_lead_to_the_same_position() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        await page.ask(do="effect", effect="nose_height", on=True, value=0.64)
        await page.ask(do="effect", effect="squirt", on=False)
        await page.ask(do="shoot", shot={**BREAK, "azimuth": 0.013})
        await page.ask(do="place", balls={"3": None})
        scene = table.backend.scene
        link = json.dumps(link_document(scene))
        file = (await page.ask(do="save"))["text"]
        for text in (link, file):
            await page.ask(do="set", scene="three_cushion")
            assert table.backend.scene != scene
            assert "error" not in await page.ask(do="load", text=text)
            assert table.backend.scene == scene
        assert len(link) < 1600

    talk(about)


def test_a_link_to_what_lies_there_changes_nothing() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        await page.ask(do="load", text=json.dumps(link_document(table.backend.scene)))
        assert (await page.ask(do="undo"))["error"] == "there is nothing to undo"

    talk(about)


def test_another_table_or_physics_racks_the_game_anew() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        await page.ask(do="set", table="pool_7ft")
        assert table.backend.scene == dataclasses.replace(bs.scenes.eight_ball(table=bs.Table.pool_7ft()), shot=None)
        await page.ask(do="place", balls={"1": [0.5, 0.5]})
        await page.ask(do="set", physics="paper")  # balls of the same size stay where they are
        assert table.backend.scene.physics == bs.Physics()
        assert table.backend.scene.positions[1].tolist() == [0.5, 0.5]
        assert "error" in await page.ask(do="set", table="carom_7ft")

    talk(about)


def test_balls_that_move_at_the_start_are_let_go() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        await page.ask(do="set", scene="head_on")
        told = await page.table()
        simulation = bs.Simulation(bs.scenes.head_on())
        simulation.run()
        assert [ball["at"] for ball in told["table"]["balls"]] == simulation.positions.tolist()
        assert told["run"]["end"] == simulation.time

    talk(about)


def test_a_shot_that_never_ends_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine_backend, "MOST_WORK", 0.0)
    monkeypatch.setattr(simulation_module, "BATCH", 10)

    async def about(table: Table) -> None:
        page = await table.page()
        assert "the balls do not rest after" in (await page.ask(do="shoot", shot=BREAK))["error"]
        physics = bs.Physics(rolling_friction=0.0)
        endless = bs.Scene([[1.0, 0.5], [1.5, 0.5]], physics=physics)
        await page.ask(do="load", text=json.dumps(link_document(endless)))
        assert "the balls never rest" in (await page.ask(do="preview", shot={"speed": 1.0, "azimuth": 0.0}))["error"]

    talk(about)


MISTAKES: tuple[tuple[str | bytes, str], ...] = (
    ("", "a message must be JSON, got ''"),
    ("{", "a message must be JSON"),
    ("[" * 100_000, "a message must be JSON"),
    ("[]", "a message must be a JSON map"),
    (b"\x00\xff", "a message must be text"),
    ('{"id": "1"}', "id must be a whole number"),
    ('{"do": "explode"}', "do must be one of preview, shoot"),
    ('{"do": ["shoot"]}', "do must be one of"),
    ('{"do": "shoot"}', "shot must be a map"),
    ('{"do": "shoot", "shot": {"speed": NaN}}', "shot.speed must be a finite number"),
    ('{"do": "shoot", "shot": {"speed": 1e999}}', "shot.speed must be a finite number"),
    ('{"do": "shoot", "shot": {"speed": true}}', "shot.speed must be a finite number"),
    ('{"do": "shoot", "shot": {"speed": 1, "azimut": 2}}', "shot has no 'azimut'"),
    ('{"do": "shoot", "shot": {"speed": 1, "ball": "99"}}', "no ball is named '99'"),
    ('{"do": "shoot", "shot": {"speed": 1, "ball": 3}}', "shot.ball must be the name"),
    ('{"do": "preview", "shot": {"speed": 1}, "without": "air"}', "without must be one of elastic"),
    ('{"do": "preview", "shot": {"speed": -1}}', "speed must be > 0"),
    ('{"do": "place", "balls": {"1": 3}}', "position of ball '1' must be 2 numbers"),
    ('{"do": "place", "balls": {"1": [NaN, 1]}}', "must be finite"),
    ('{"do": "place", "balls": {"99": [1, 1]}}', "no ball is named '99'"),
    ('{"do": "effect", "effect": "elastic", "on": 1}', "on must be true or false"),
    ('{"do": "effect", "effect": "elastic", "on": true, "value": "x"}', "Elastic contacts must be a finite number"),
    ('{"do": "set", "scene": "/etc/passwd"}', "scene must be one of head_on"),
    ('{"do": "set", "scene": {}}', "scene must be one of head_on"),
    ('{"do": "load", "text": 1}', "text must be that of a scene file"),
    ('{"do": "load", "text": "!!python/object {}"}', "a scene has no tags"),
    ('{"do": "load", "text": "balls: [{name: cue, position: [9, 9]}]"}', "into a rail"),
)


def test_a_mistake_gets_one_line_and_the_server_lives_on() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        scene = table.backend.scene
        for text, wanted in MISTAKES:
            await page.send(text)
            answer = await page.read()
            assert wanted in answer["error"], text[:80]
            assert "\n" not in answer["error"]
            assert len(answer["error"]) < 600
        assert table.backend.scene is scene
        assert "run" in await page.ask(do="preview", shot=BREAK)

    talk(about)


def test_a_message_that_is_too_long_ends_its_connection_alone() -> None:
    async def about(table: Table) -> None:
        page, long = await table.page(), await table.page()
        await long.send("x" * (server.MOST_BYTES + 1))
        assert await long.read() is None
        assert "run" in await page.ask(do="preview", shot=BREAK)

    talk(about)


def test_a_flood_is_refused_and_others_are_served_meanwhile() -> None:
    async def about(table: Table) -> None:
        page, flooding = await table.page(), await table.page()
        complaints = []

        async def read() -> None:
            while (heard := await flooding.read()) is not None:
                complaints.append(heard["error"])
                if heard.get("id") == 7:
                    return

        reading = asyncio.create_task(read())
        for _ in range(10_000):
            await flooding.send("{bad")
        assert "run" in await page.ask(do="preview", shot=BREAK)
        while not reading.done():  # the allowance comes back to whoever asks ten times a second
            await flooding.send('{"id": 7, "do": "nothing"}')
            await asyncio.wait([reading], timeout=0.1)
        await reading
        dropped = [line for line in complaints if line.startswith("more than 100 messages a second")]
        assert 1 <= len(dropped) <= 60
        assert server.BURST <= len(complaints) < 9_000

    talk(about)


def test_of_many_previews_the_latest_is_answered_and_the_rest_is_dropped() -> None:
    async def about(table: Table) -> None:
        page = await table.page()
        begun, gate = asyncio.Event(), asyncio.Event()
        answer = table.backend.answer

        async def slow(asked: Any) -> Any:
            begun.set()
            await gate.wait()
            return await answer(asked)

        async def send(identity: int) -> None:
            await page.send(json.dumps({"id": identity, "do": "preview", "shot": {"speed": float(identity)}}))

        table.backend.answer = slow  # type: ignore[method-assign]
        await send(1)
        await begun.wait()
        for identity in range(2, 6):
            await send(identity)
        assert [await page.read() for _ in range(3)] == [{"id": number, "dropped": True} for number in (2, 3, 4)]
        gate.set()
        answers = [await page.read() for _ in range(2)]
        assert [one["id"] for one in answers if "run" in one] == [1, 5]

    talk(about)


@pytest.mark.parametrize("origin", ["http://example.org", "http://127.0.0.1:1", "http://localhost.example.org", "null"])
def test_a_page_of_another_site_is_refused(origin: str) -> None:
    async def about(table: Table) -> None:
        with pytest.raises(tornado.httpclient.HTTPError, match="403"):
            await table.page(Origin=origin)
        await table.page(Origin=f"http://127.0.0.1:{table.port}")

    talk(about)


@pytest.mark.parametrize(
    "host", ["example.org", "example.org:8321", "127.0.0.1.example.org", "10.0.0.1", "localhost:x"]
)
def test_another_name_of_this_machine_is_refused(host: str) -> None:
    async def about(table: Table) -> None:
        assert (await table.get("/", Host=host)).code == 403
        with pytest.raises(tornado.httpclient.HTTPError, match="403"):
            await table.page(Host=host, Origin=f"http://{host}")
        for own in ("localhost:9000", "127.0.0.1", "[::1]:80"):
            assert (await table.get("/", Host=own)).code == 200

    talk(about)


def test_the_page_and_nothing_else_is_served() -> None:
    async def about(table: Table) -> None:
        page = await table.get("/")
        assert b"<canvas" in page.body
        assert "default-src 'self'" in page.headers["Content-Security-Policy"]
        assert (await table.get("/main.js")).code == 200
        for path in ("/../server.py", "/%2e%2e/server.py", "//etc/passwd", "/nothing.js"):
            assert (await table.get(path)).code in (400, 403, 404), path

    talk(about)


def test_the_page_loads_nothing_from_elsewhere() -> None:
    for path in server.PAGE.iterdir():
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert "http:" not in text.replace('"https:" ? "wss" : "ws"', ""), path.name
        assert "https://" not in text, path.name
        assert "SPDX-License-Identifier: Apache-2.0" in text, path.name


def test_no_more_pages_than_are_allowed() -> None:
    async def about(table: Table) -> None:
        for _ in range(server.MOST_PAGES):
            await table.page()
        more = await table.page(greeted=False)
        assert await more.read() is None
        table.pages[0].connection.close()
        while len(table.backend.tell.__self__.all) == server.MOST_PAGES:  # type: ignore[attr-defined]
            await asyncio.sleep(0.01)
        await table.page()

    talk(about)


def test_a_page_that_does_not_read_is_closed_and_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MOST_UNREAD", 3)

    async def about(table: Table) -> None:
        await table.page(greeted=False)
        deaf = next(iter(table.backend.tell.__self__.all))  # type: ignore[attr-defined]
        deaf.write_message = lambda *_: asyncio.Event().wait()
        page = await table.page()
        for _ in range(6):
            await page.ask(do="shoot", shot=BREAK)
            await page.ask(do="undo")
        assert deaf not in table.backend.tell.__self__.all  # type: ignore[attr-defined]

    talk(about)


def test_a_port_that_is_taken_is_refused_in_one_line() -> None:
    async def about(table: Table) -> None:
        with pytest.raises(Refusal, match=f"port {table.port} cannot be had .*: name another one with --port"):
            server.serve(EngineBackend(bs.scenes.eight_ball()), table.port)

    talk(about)


def test_a_cue_shot_of_a_scene_is_the_first_aim() -> None:
    scene = bs.scenes.eight_ball()
    force = scene.physics.mass * 3.0 / scene.physics.cue_contact_time
    offset = (0.1 * scene.physics.radius, -0.2 * scene.physics.radius)
    shot = bs.Shot((0.0, force, -force), offset)
    _, told = EngineBackend(dataclasses.replace(scene, shot=shot)).greeting()
    wanted = {"speed": 3.0, "azimuth": np.pi / 2, "side": 0.1, "up": -0.2, "elevation": np.pi / 4}
    assert {key: told["aim"][key] for key in wanted} == pytest.approx(wanted, abs=1e-12)
