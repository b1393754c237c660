# SPDX-License-Identifier: Apache-2.0
"""The page of a running table in a real browser: what is done there is done on the table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import STATE, Page, launched, need_a_browser
from conftest import Site

import billiards_sim as bs

need_a_browser()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched() as browser:
        yield browser


def test_it_is_aimed_at_shot_placed_paused_and_undone(browser: Any, site: Site) -> None:
    site.table("scene:=nine_ball", "real_time_factor:=4.0")
    play = site.process("play", "--ros", "--no-browser", "--port", "0")
    play.wait_for("(Ctrl-C")
    context = browser.new_context(viewport={"width": 1000, "height": 700})
    page = Page(context.new_page()).open(play.stdout.split()[1])
    scene = bs.scenes.nine_ball()
    start = scene.positions.tolist()

    page.move((2.0, 0.785))
    run = page.preview()["run"]
    simulation, wanted = page.aimed(scene)
    assert run["end"] == pytest.approx(wanted.end, abs=1e-9)
    assert [event["kind"] for event in run["events"]] == [event.kind for event in wanted.events]
    page("document.querySelector('#table').focus()")
    page.page.keyboard.press("Space")
    page.until(lambda: page(f"{STATE}.rolling"))
    rest = [at if there else None for at, there in zip(simulation.positions.tolist(), simulation.in_play)]
    page.until(lambda: not page(f"{STATE}.rolling") and page.places == rest)
    turns = page("billiards.turns")
    assert any(np.abs(turn[3]) < 0.9 for turn in turns.values())
    page.until(lambda: f"{wanted.end:.2f} s" in page("document.querySelector('#happened').textContent"))

    page.until(lambda: page(f"{STATE}.preview !== null") and page.said.startswith("This shot"))
    page.until(lambda: page("!document.querySelector('#undo').disabled"))
    page.page.keyboard.press("u")
    page.until(lambda: page.places == start)
    page.drag(start[1], (0.9, 0.5))
    page.until(lambda: page.places[1] == pytest.approx([0.9, 0.5], abs=2e-3))
    moved = page.places
    page.drag(moved[1], start[0])
    page.until(lambda: "balls 'cue' and '1' overlap" in page.said)
    assert page.places == moved

    page.page.click("[aria-label='Compare with and without: Elastic contacts']")
    page.until(lambda: page(f"{STATE}.preview?.without"))
    page.choose("#pace", "0.25")
    page.until(lambda: page.table["pace"] == 0.25)
    page.page.click("#pause")
    page.until(lambda: page("document.querySelector('#pause').ariaPressed") == "true")
    page("billiards.aim.setAll({ speed: 2, azimuth: 0.5 })")
    page.page.click("#shoot")
    page.page.click("#tick")
    page.page.keyboard.press(".")
    page.until(lambda: page(f"{STATE}.rolling"))
    page.page.keyboard.press("p")
    page.until(lambda: not page(f"{STATE}.rolling"))
    assert page.trouble == []
    context.close()
    play.signal(2)
    assert play.wait() == 0


def test_a_link_moves_no_balls_of_a_running_table(browser: Any, site: Site) -> None:
    site.table("scene:=nine_ball")
    play = site.process("play", "--ros", "--no-browser", "--port", "0")
    play.wait_for("(Ctrl-C")
    address = play.stdout.split()[1]
    context = browser.new_context()
    page = Page(context.new_page()).open(address)
    start, link = page.places, page.link()
    page.drag(start[0], (0.5, 0.4))
    page.until(lambda: page.places != start)
    moved = page.places
    other = Page(context.new_page()).open(f"{address}{link}")
    other.preview()
    assert other.places == moved
    assert page.places == moved
    page.until(lambda: page.scene().positions.tolist() == moved)
    context.close()
