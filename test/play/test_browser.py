# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, held to the engine."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import STATE, Page, Server, launched, need_a_browser

import billiards_sim as bs
from billiards_sim.engine.scene_file import load_scene
from billiards_sim.play.effects import EFFECTS
from billiards_sim.study import simulate

need_a_browser()

ENDS = """async (run) => {
    const { placeAt } = await import("./motion.js");
    return run.arcs.map((arcs) => placeAt(arcs, run.end, billiards.state.table.centre));
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched() as browser:
        yield browser


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    assert server.stop() == 0


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Page]:
    """A desktop's page of an eight-ball rack."""
    context = browser.new_context(viewport={"width": 960, "height": 600})
    page = Page(context.new_page()).open(server.address)
    page.choose("#scene", "three_cushion")
    page.until(lambda: page.table["scene"] == "three_cushion")
    page.choose("#scene", "eight_ball")
    page.until(lambda: page.table["scene"] == "eight_ball" and page.places == bs.scenes.eight_ball().positions.tolist())
    yield page
    assert page.trouble == []
    context.close()


def in_play(simulation: bs.Simulation) -> list[Any]:
    return [at if there else None for at, there in zip(simulation.positions.tolist(), simulation.in_play)]


def test_the_page_shows_the_balls_where_they_lie(page: Page) -> None:
    scene = bs.scenes.eight_ball()
    draw = """() => {
            const { view, state } = billiards;
            return state.table.balls.map((ball) => {
                const [x, y] = view.at([ball.at[0] + 0.75 * state.table.radius, ball.at[1]]);
                return [...view.context.getImageData(x, y, 1, 1).data];
            });
        }"""
    page.until(lambda: page(draw)[1][0] > 100)  # the page draws at the next frame
    colours = page(draw)
    cloth = page("[...billiards.view.context.getImageData(billiards.view.canvas.width / 2, 100, 1, 1).data]")
    assert len(colours) == len(scene)
    assert cloth[2] > cloth[0] + 60  # blue-green
    (red, green, blue, _), black = colours[1], colours[8]
    assert red > 100 and green > 80 and blue < 90  # 1 is yellow
    assert max(black[:3]) < 90  # 8


def test_the_cue_follows_the_mouse_and_the_preview_is_the_engines(page: Page) -> None:
    scene = bs.scenes.eight_ball()
    cue, target = scene.positions[0], (1.4, 1.1)
    page.move(target)
    page.until(lambda: abs(page("billiards.aim.values.azimuth") - np.arctan2(*(target - cue)[::-1])) < 2e-3)
    run = page.preview()["run"]
    simulation, wanted = page.aimed(scene)
    assert run["end"] == wanted.end
    assert page(ENDS, run) == simulation.positions.tolist()
    assert [event["time"] for event in run["events"]] == [event.time for event in wanted.events]


def test_a_click_holds_the_aim(page: Page) -> None:
    page.move((1.4, 1.1))
    page.page.mouse.click(*page.on_screen((1.4, 1.1)))
    held = page("billiards.aim.values.azimuth")
    page.move((1.4, 0.4))
    assert page("billiards.aim.values.azimuth") == held
    page.page.mouse.click(*page.on_screen((1.4, 0.4)))
    page.move((1.4, 0.4))
    assert page("billiards.aim.values.azimuth") != held


def test_a_shot_is_played_with_the_engines_bits_and_ends_where_it_ends(page: Page) -> None:
    scene = bs.scenes.eight_ball()
    page.move((2.0, 0.785))
    page.preview()
    page.choose("[data-player=rate]", "0.25")  # so that it is still on when it is paused
    simulation, run = page.aimed(scene)
    page("document.querySelector('#table').focus()")
    page.page.keyboard.press("Space")
    page.until(lambda: page("billiards.player.shows && billiards.player.time > 0.3"))
    page.page.keyboard.press("p")  # pause
    time, shown = page(
        """async () => {
            const { placeAt } = await import("./motion.js");
            const { player, state } = billiards;
            return [player.time, player.run.arcs.map((arcs) => placeAt(arcs, player.time, state.table.centre))];
        }"""
    )
    assert 0.0 < time < run.end
    assert shown == run.positions([time])[0].tolist()
    page.page.keyboard.press(".")
    ticked = page("billiards.player.time")
    assert ticked != time
    assert ticked == pytest.approx(0.01 * round(ticked / 0.01), abs=1e-9)
    page.choose("[data-player=rate]", "4")
    page("document.querySelector('#table').focus()")
    page.page.keyboard.press("p")
    page.until(lambda: not page("billiards.player.shows"))
    assert page.places == in_play(simulation)
    pocketed = [event.balls[0] for event in run.events if event.kind == "pocketed" and event.balls[0] != "cue"]
    happened = page("document.querySelector('#happened').textContent")
    assert f"{run.end:.2f} s" in happened
    assert all(name in happened for name in pocketed)


def test_balls_turn_as_in_the_engine(page: Page) -> None:
    page("billiards.aim.setAll({ side: 0.3, up: 0.2, azimuth: 0.01, speed: 6 })")
    _, run = page.aimed(bs.scenes.eight_ball())
    page.page.click("#shoot")
    page.until(lambda: page("billiards.player.run !== null"))
    page.page.click("[data-player=play]")
    times = np.linspace(0.05, run.end, 6)
    shown = np.array(
        page(
            """(times) => times.map((time) =>
                billiards.player.run.names.map((_, index) => billiards.state.turning.at(index, time)))""",
            times.tolist(),
        )
    )
    wanted = run.orientations(times)
    # a quaternion and its negative turn alike; what is left out of a step grows with time
    assert np.abs(np.sum(shown * wanted, axis=2)).min() > 1.0 - 1e-4
    assert np.abs(wanted[-1, :, 3]).min() < 0.9


def test_a_ball_is_dragged_refused_taken_off_and_all_is_undone(page: Page) -> None:
    start = page.places
    page.drag(start[1], (0.9, 0.5))
    page.until(lambda: page.places != start)
    moved = page.places[1]
    assert moved == pytest.approx([0.9, 0.5], abs=2e-3)
    page.drag(moved, start[0])
    page.until(lambda: "balls 'cue' and '1' overlap" in page.said)
    assert page.places[1] == moved
    page(f"{STATE}.refused = Infinity")  # a moment that does not pass
    page.move((2.0, 0.6))
    page.preview()
    assert "overlap" in page.said
    page(f"{STATE}.refused = -Infinity")  # long ago
    page.move((2.0, 0.7))
    page.until(lambda: page.said.startswith("This shot"))
    page.drag(moved, (1.4, -0.02))
    page.until(lambda: page.places[1] is None)
    page.page.click("[data-ball='1']")
    page.page.click("[data-off]")
    page.until(lambda: page.places[1] is not None)
    for wanted in (None, moved, start[1]):
        page.page.keyboard.press("u")
        page.until(lambda wanted=wanted: page.places[1] == wanted)
    assert page.places == start


def test_a_cue_ball_that_fell_is_put_where_one_clicks(page: Page) -> None:
    scratch = {"speed": 1.5, "azimuth": np.arctan2(0.762, 0.7048 - 0.05) + np.pi}  # into the corner behind it
    page("(values) => billiards.aim.setAll(values)", scratch)
    page.preview()
    page.page.click("#shoot")
    page.until(lambda: page("billiards.player.run !== null"))
    page.page.click("[data-player=end]")
    page.until(lambda: page.places[0] is None and "The cue ball is off the table" in page.said)
    page.page.mouse.click(*page.on_screen(page.places[1]))
    page.until(lambda: "balls 'cue' and '1' overlap" in page.said)
    page.page.mouse.click(*page.on_screen((0.6, 0.9)))
    page.until(lambda: page.places[0] == pytest.approx([0.6, 0.9], abs=2e-3))
    page.until(lambda: page.said.startswith("This shot"))


def test_space_shoots_when_the_mouse_is_back_on_the_table(page: Page) -> None:
    page.page.click("[aria-label='Compare with and without: Squirt']")
    page.page.keyboard.press("Space")  # the button's, as for every button
    assert page("document.activeElement.ariaPressed") == "false"
    page.move((2.0, 0.785))
    page.page.keyboard.press("Space")
    page.until(lambda: page("billiards.player.run !== null"))


def test_an_effect_is_switched_and_compared(page: Page) -> None:
    scene = bs.scenes.eight_ball()
    page.move((2.0, 0.785))
    page.preview()
    page.page.click("[aria-label='Compare with and without: Elastic contacts']")
    page.until(lambda: page("billiards.state.preview?.without"))
    rigid = EFFECTS["elastic"].switched(scene, False)
    for which, wanted in (("run", scene), ("without", rigid)):
        simulation, run = page.aimed(wanted)
        shown = page(f"billiards.state.preview.{which}")
        assert shown["end"] == run.end
        assert page(ENDS, shown) == simulation.positions.tolist()
    page.page.click("label[for=effect-elastic]")
    page.until(lambda: page.table["physics"] is None)
    page.preview()
    simulation, run = page.aimed(rigid)
    assert page("billiards.state.preview.run.end") == run.end
    assert page.scene() == replace(rigid, shot=None)


def test_a_link_brings_back_position_and_aim_on_another_server(page: Page, browser: Any) -> None:
    page("billiards.aim.setAll({ speed: 5, azimuth: 0.02, side: 0.25, up: -0.125 })")
    simulation, _ = page.aimed(bs.scenes.eight_ball())
    page.page.click("#shoot")
    page.until(lambda: page.places == in_play(simulation))
    link, places = page.link(), page.places
    page.page.reload()
    page.until(lambda: page("window.billiards?.state.table?.balls.length"))
    assert page.places == places
    other = Server("snooker")
    try:
        context = browser.new_context()
        opened = Page(context.new_page()).open(f"{other.address}{link}")
        opened.until(lambda: opened.places == places)
        aim = {"speed": 5, "azimuth": 0.02, "side": 0.25, "up": -0.125, "elevation": 0}
        opened.until(lambda: opened("billiards.aim.values") == aim)  # the table brings another, then comes the link's
        assert opened.trouble == []
        context.close()
    finally:
        assert other.stop() == 0


def test_a_scene_file_is_loaded_and_saved(page: Page, tmp_path: Path) -> None:
    scene = bs.Scene([[0.5, 0.4], [1.5, 0.8]], physics=bs.Physics.pool(), name="two")
    bs.save_scene(scene, tmp_path / "two.yaml")
    page.page.set_input_files("#file", tmp_path / "two.yaml")
    page.until(lambda: page.table["scene"] == "two")
    assert page.scene() == scene
    with page.page.expect_download() as download:
        page.page.click("#save")
    download.value.save_as(tmp_path / "saved.yaml")
    assert download.value.suggested_filename == "two.yaml"
    assert bs.load_scene(tmp_path / "saved.yaml") == scene
    (tmp_path / "bad.yaml").write_text("balls: 3", encoding="utf-8")
    page.page.set_input_files("#file", tmp_path / "bad.yaml")
    page.until(lambda: "balls must be a list" in page.said)


def test_two_pages_see_the_same_table(page: Page, browser: Any, server: Server) -> None:
    context = browser.new_context()
    other = Page(context.new_page()).open(server.address)
    page.drag(page.places[0], (0.5, 0.4))
    for one in (page, other):
        one.until(lambda one=one: one.places[0] == pytest.approx([0.5, 0.4], abs=2e-3))
    assert other.places == page.places
    other.page.click("#shoot")
    for one in (page, other):
        one.until(lambda one=one: one("billiards.player.run !== null"))
    assert page("billiards.player.run.arcs") == other("billiards.player.run.arcs")
    context.close()


def test_at_the_end_of_a_run_the_next_shot_is_foreseen_however_the_end_is_reached(page: Page) -> None:
    for skip in ("[data-player=end]", "#shoot"):
        page.page.click("#shoot")
        page.until(lambda: page("billiards.player.shows"))
        page.page.click(skip)
        page.until(lambda: page(f"{STATE}.preview !== null") and page.said.startswith("This shot"))
        page.page.click("#undo")
        page.until(lambda: page.places == bs.scenes.eight_ball().positions.tolist())


@pytest.mark.parametrize("rate", ["0.25", "1", "2"])
def test_balls_roll_at_the_speed_that_is_chosen(page: Page, rate: str) -> None:
    page.choose("[data-player=rate]", rate)
    page.page.click("#shoot")
    page.until(lambda: page("billiards.player.time > 0"))
    # by the clock of the frames, which is what is to be kept to, slow as the machine may be
    shares = page(
        """() => new Promise((done) => {
            const { player } = billiards;
            const times = [];
            const look = (now) => {
                times.push([now / 1000, player.time]);
                if (times.length < 12) requestAnimationFrame(look);
                else done(times.slice(1).map(([at, time], index) => [at - times[index][0], time - times[index][1]]));
            };
            requestAnimationFrame(look);
        })"""
    )
    # of a longer frame, as of a page that was hidden, a tenth of a second counts
    wanted = [float(rate) * min(passed, 0.1) for passed, _ in shares]
    assert [shown for _, shown in shares] == pytest.approx(wanted, abs=1e-6)


def test_a_scene_file_is_dropped_on_the_page(page: Page) -> None:
    page(
        """(text) => {
            const data = new DataTransfer();
            data.items.add(new File([text], "two.yaml"));
            document.querySelector("#table").dispatchEvent(
                new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
        }""",
        "name: dropped\nballs:\n- {name: cue, position: [0.5, 0.5]}\n- {name: '1', position: [1.5, 0.5]}\n",
    )
    page.until(lambda: page.table["scene"] == "dropped")
    assert page.places == [[0.5, 0.5], [1.5, 0.5]]


def test_figures_are_not_cut_off(page: Page) -> None:
    page.choose("#scene", "three_cushion")  # whose figures have many digits
    page.until(lambda: page.table["scene"] == "three_cushion")
    assert (
        page(
            """() => [...document.querySelectorAll("input[type=number]")].filter(
            (field) => field.scrollWidth > field.clientWidth).map((field) => field.value)"""
        )
        == []
    )


SCREENS = [
    ((390, 844), "dark"),
    ((360, 640), "light"),
    ((844, 390), "dark"),
    ((820, 1180), "dark"),
    ((1360, 800), "light"),
]
BEYOND = """() => [...document.querySelectorAll("#player *, #said, #shot *")].filter((one) => {
    const { left, right, width } = one.getBoundingClientRect();
    return width > 0 && (left < 0 || right > innerWidth + 0.5);
}).map((one) => one.outerHTML.slice(0, 80))"""


@pytest.mark.parametrize("size, scheme", SCREENS)
def test_it_fits_every_screen_and_is_named_for_those_who_do_not_see_it(
    browser: Any, server: Server, size: tuple[int, int], scheme: str
) -> None:
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
    page = Page(context.new_page()).open(server.address)
    assert page("document.documentElement.scrollWidth") <= size[0]
    frame = page("(({ left, right, top, bottom }) => ({ left, right, top, bottom }))(table.getBoundingClientRect())")
    assert frame["left"] >= 0 and frame["right"] <= size[0] and frame["bottom"] <= size[1]
    assert page("billiards.view.turned") == (size[0] < 500)
    page.page.click("#shoot")
    page.until(lambda: page("billiards.player.time > 0.1"))
    assert page(BEYOND) == []
    assert page("document.documentElement.scrollWidth") <= size[0]
    page.page.click("#undo")
    nameless = page(
        """() => [...document.querySelectorAll("button, input:not([hidden]), select, canvas, [role]")].filter((one) =>
            !(one.ariaLabel || one.getAttribute("aria-labelledby") || one.textContent.trim()
              || one.labels?.[0]?.textContent.trim() || one.getAttribute("aria-live"))).map((one) => one.outerHTML)"""
    )
    assert nameless == []
    background = page("getComputedStyle(document.body).backgroundColor")
    channels = [int(part) for part in background[4:-1].split(",")]
    assert (max(channels) < 60) == (scheme == "dark")
    assert page.trouble == []
    context.close()


def test_everything_is_done_with_the_keyboard_alone(page: Page) -> None:
    page("document.querySelector('#table').focus()")
    before = page("billiards.aim.values")
    page.page.keyboard.press("ArrowLeft")
    page.page.keyboard.press("Shift+ArrowUp")
    after = page("billiards.aim.values")
    assert after["azimuth"] - before["azimuth"] == pytest.approx(np.radians(0.1), abs=1e-9)
    assert after["speed"] - before["speed"] == pytest.approx(1.0, abs=1e-9)
    page("document.querySelector('[data-tip]').focus()")
    page.page.keyboard.press("ArrowLeft")
    page.page.keyboard.press("ArrowUp")
    assert page("[billiards.aim.values.side, billiards.aim.values.up]") == [0.02, 0.02]
    start = page.places
    page("document.querySelector('[data-ball=\"3\"]').focus()")
    page.page.keyboard.press("Enter")
    page("document.querySelector('[data-place=x]').focus()")
    page.page.keyboard.press("Control+a")
    page.page.keyboard.type("1.25")
    page.page.keyboard.press("Enter")
    page.until(lambda: page.places[3] == [1.25, start[3][1]])
    page("document.activeElement.blur()")
    page.page.keyboard.press("Space")
    page.until(lambda: page("billiards.player.run !== null"))


def test_a_run_in_a_file_plays_without_a_server(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "break.html"
    assert simulate.main(["nine_ball", "--speed", "8", "--angle", "1deg", "--html", str(path)]) == 0
    simulation = bs.Simulation(bs.scenes.nine_ball())
    simulation.shoot(8.0, np.pi / 180.0)
    run = bs.record(simulation)
    context = browser.new_context(viewport={"width": 960, "height": 600}, offline=True)
    page = Page(context.new_page())
    page.page.goto(path.as_uri())
    page.until(lambda: page("window.billiards?.playback.run !== undefined"))
    assert page("billiards.playback.run.end") == run.end
    page.page.keyboard.press("Space")
    page.until(lambda: page("billiards.playback.time > 0.2"))
    page.page.keyboard.press("Space")
    assert 0.2 < page("billiards.playback.time") < run.end
    collisions = [event for event in run.events if event.kind == "ball_ball"]
    page.page.click("summary")
    page.page.click(f"[data-time='{collisions[-1].time!r}']")
    assert page("billiards.playback.time") == collisions[-1].time
    assert page("document.querySelectorAll('[data-player=marks] line').length") > len(collisions)
    page.page.click("[data-player=end]")
    assert page("billiards.playback.time") == run.end
    assert page.trouble == []
    context.close()


SPINNING = """
table: pool_9ft
physics: pool
balls:
  - {name: cue, position: [0.8, 0.7], angular_velocity: [0.0, 0.0, 30.0]}
"""


@pytest.mark.parametrize("scene", ["glancing", "spinning"])
def test_a_run_in_a_file_tells_when_the_balls_rest_if_they_do(browser: Any, tmp_path: Path, scene: str) -> None:
    file = tmp_path / "spinning.yaml"
    file.write_text(SPINNING)
    given = str(file) if scene == "spinning" else scene
    end = bs.record(bs.Simulation(load_scene(file) if scene == "spinning" else bs.scenes.glancing())).end
    context = browser.new_context(viewport={"width": 960, "height": 600}, offline=True)
    page = Page(context.new_page())
    for until, wanted in (
        (0.5 * end, f"balls still move after {0.5 * end:.2f} s."),
        (None, f"at rest after {end:.2f} s."),
        (end + 10.0, f"at rest after {end:.2f} s."),
    ):
        path = tmp_path / "run.html"
        assert simulate.main([given, "--html", str(path), *(("--until", repr(until)) if until else ())]) == 0
        page.page.goto(path.as_uri())
        page.until(lambda: page("window.billiards?.playback.run !== undefined"))
        assert page("document.querySelector('#happened').textContent").endswith(wanted)
    assert page.trouble == []
    context.close()
