# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, with what it does in words: for tests, and for those who measure."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import billiards_sim as bs
from billiards_sim.engine.scene_file import read_scene

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)
OPTIONS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PATIENCE = 60.0
"""s that the page has for anything."""

STATE = "billiards.state"


def need_a_browser() -> None:
    """Skip the tests of a module where there is none."""
    if BROWSER is None:
        pytest.skip(f"needs a browser: none of {', '.join(BROWSERS)} is installed", allow_module_level=True)
    pytest.importorskip("playwright.sync_api", reason="needs playwright, which drives the browser")
    pytest.importorskip("tornado")


@contextmanager
def launched() -> Iterator[Any]:
    """A browser without a screen."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=BROWSER, args=list(OPTIONS))
        yield browser
        browser.close()


class Server:
    """`play` in a process of its own."""

    def __init__(self, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "billiards_sim", "play", "--no-browser", "--port", "0", *arguments],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().split()[1]

    def stop(self) -> int:
        self._process.terminate()  # SIGINT is ignored by what was started in the background
        return self._process.wait(PATIENCE)


class Page:
    """A page that is open, with what it does in words."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.trouble: list[str] = []
        page.on("pageerror", lambda error: self.trouble.append(str(error)))
        page.on("console", lambda line: line.type == "error" and self.trouble.append(line.text))

    def __call__(self, expression: str, *given: Any) -> Any:
        return self.page.evaluate(expression, *given)

    def until(self, done: Callable[[], Any]) -> Any:
        for _ in range(int(PATIENCE / 0.05)):
            if value := done():
                return value
            self.page.wait_for_timeout(50)
        raise AssertionError("the page does not come to it")

    def open(self, address: str) -> Page:
        self.page.goto(address)
        self.until(lambda: self("window.billiards?.state.table?.balls.length"))
        return self

    @property
    def table(self) -> Any:
        return self(f"{STATE}.table")

    @property
    def places(self) -> list[Any]:
        return [ball["at"] for ball in self.table["balls"]]

    @property
    def said(self) -> str:
        return str(self("document.querySelector('#said').textContent"))

    def on_screen(self, place: Any) -> tuple[float, float]:
        x, y = self(
            """([x, y]) => {
                const { view } = billiards;
                const [px, py] = view.at([x, y]);
                const frame = view.canvas.getBoundingClientRect();
                return [frame.left + px / view.ratio, frame.top + py / view.ratio];
            }""",
            list(place),
        )
        return x, y

    def move(self, place: Any) -> None:
        self.page.mouse.move(*self.on_screen(place))

    def drag(self, start: Any, end: Any) -> None:
        self.move(start)
        self.page.mouse.down()
        self.move([0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])])
        self.move(end)
        self.page.mouse.up()

    def choose(self, selector: str, value: str) -> None:
        self.page.select_option(selector, value)

    def preview(self) -> Any:
        """That of the present aim."""
        return self.until(
            lambda: self(
                """() => {
                    const { aim, state } = billiards;
                    const same = ([name, value]) => value === state.preview?.shot[name];
                    return Object.entries(aim.values).every(same) && state.preview;
                }"""
            )
        )

    def aimed(self, scene: bs.Scene) -> tuple[bs.Simulation, Any]:
        """What the engine makes of the present aim."""
        simulation = bs.Simulation(scene)
        simulation.shoot(**self("billiards.aim.values"))
        return simulation, bs.record(simulation)

    def link(self) -> str:
        """That in the address bar, once it is that of the position and the aim."""
        wanted = f"({{ encoded }}) => encoded({{ scene: {STATE}.table.link, aim: billiards.aim.values }})"
        self.until(lambda: self(f"import('./link.js').then({wanted}).then((link) => location.hash === `#${{link}}`)"))
        return str(self("location.hash"))

    def scene(self) -> bs.Scene:
        """The scene of the link in the address bar."""
        link = self("(link) => import('./link.js').then(({ decoded }) => decoded(link.slice(1)))", self.link())
        return read_scene(json.dumps(link["scene"]))
