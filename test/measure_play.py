# SPDX-License-Identifier: Apache-2.0
"""What the table in the browser costs and stands: the figures of docs/play.md.

python test/measure_play.py [start] [preview] [frames] [processor] [flood] [ros] [--seconds 10] [--rate 1000]

Needs a browser, which runs without a screen and without a graphics processor, and playwright; `ros` needs rclpy. Each
part starts servers of its own on this machine and prints one line of JSON. Exit code 1: a figure is out of its bounds;
"broken" names it.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import multiprocessing
import os
import struct
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Coroutine, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from browser import launched
from playwright.sync_api import Page

from billiards_sim.play.server import MOST_BYTES

MOST_ROUND_TRIP = 30e-3  # s, median
MOST_SHARE = 0.15  # of a core
MOST_START = 1.5  # s
MOST_GROWTH = 30e6  # bytes of memory that a flood may take
STARTS = 7

TIMED = """
window.trips = [];
window.dropped = 0;
const began = new Map();
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (text) {
    if (began.size === 0) {
        this.addEventListener("message", ({ data }) => {
            const id = Number(/^{"id": (\\d+)/.exec(data)?.[1]);
            if (data.includes('"dropped": true')) window.dropped += 1;
            if (began.get(id)) window.trips.push(performance.now() - began.get(id));
        });
    }
    const message = JSON.parse(text);
    began.set(message.id, message.do === "preview" ? performance.now() : 0);
    send.call(this, text);
};
const clip = CanvasRenderingContext2D.prototype.clip;  // of a ball, and of nothing else
CanvasRenderingContext2D.prototype.clip = function (...given) {
    if (!window.drawn) requestAnimationFrame(() => {
        window.drawn = (performance.timeOrigin + performance.now()) / 1000;
    });
    clip.apply(this, given);
};
"""
"""Keeps the round trips of previews, ms, and the moment when the first ball is on the screen, s."""


@contextmanager
def serving(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`play` in a process of its own, and its address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "billiards_sim", "play", "--no-browser", "--port", "0", *arguments],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process, process.stdout.readline().split()[1]
    finally:
        process.terminate()
        process.wait(30.0)


def until(page: Page, expression: str) -> None:
    deadline = time.monotonic() + 60.0
    while not page.evaluate(expression):
        if time.monotonic() > deadline:
            raise TimeoutError(expression)
        page.wait_for_timeout(20)


@contextmanager
def opened(browser: Any, address: str) -> Iterator[Page]:
    """A page that shows the preview of its first aim."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    page.add_init_script(TIMED)
    page.goto(address)
    until(page, "!!window.billiards?.state.preview")
    yield page
    context.close()


def aim_about(page: Page, seconds: float) -> dict[str, Any]:
    """Move the mouse over a rack 60 times a second; what became of the previews."""
    table = page.evaluate("billiards.state.table")
    (foot_x, foot_y), radius = table["foot_spot"], table["radius"]
    page.evaluate("trips.length = 0; dropped = 0")
    began = time.monotonic()
    moves = 0
    while (passed := time.monotonic() - began) < seconds:
        place = [foot_x, foot_y + 1.5 * radius * math.sin(4.0 * passed)]
        x, y = page.evaluate(
            """(place) => {
                const { canvas, ratio } = billiards.view;
                const { left, top } = canvas.getBoundingClientRect();
                const [x, y] = billiards.view.at(place);
                return [left + x / ratio, top + y / ratio];
            }""",
            place,
        )
        page.mouse.move(x, y)
        moves += 1
        page.wait_for_timeout(max(1000.0 * (began + moves / 60.0 - time.monotonic()), 0.0))
    trips = np.array(page.evaluate("trips")) / 1000.0
    return {
        "moves_per_second": moves / seconds,
        "previews_per_second": len(trips) / seconds,
        "round_trip_median": float(np.median(trips)),
        "round_trip_p95": float(np.quantile(trips, 0.95)),
        "events_of_a_preview": page.evaluate("billiards.state.preview.run.events.length"),
    }


def processor_time(pid: int) -> float:
    """User and system time of a process so far, s (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory(pid: int) -> int:
    """Bytes that a process has in memory (Linux)."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def share(pid: int, seconds: float, meanwhile: Callable[[float], object]) -> float:
    """The share of a core that a process takes."""
    before, began = processor_time(pid), time.monotonic()
    meanwhile(seconds)
    return (processor_time(pid) - before) / (time.monotonic() - began)


# ---- parts; each returns its figures and what is out of bounds


def start(browser: Any, _: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """From the command to the first ball on the screen of a browser that runs; the second time on, so warm."""
    took = []
    for _ in range(1 + STARTS):
        began = time.time()
        with serving() as (_, address):
            context = browser.new_context(viewport={"width": 1280, "height": 800})
            page = context.new_page()
            page.add_init_script(TIMED)
            page.goto(address)
            until(page, "window.drawn")
            took.append(page.evaluate("window.drawn") - began)
            context.close()
    figures = {"median": float(np.median(took[1:])), "longest": max(took[1:]), "first": took[0]}
    return figures, ["median"] * (figures["median"] > MOST_START)


def preview(browser: Any, options: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """Previews of a break with everything on while the mouse moves."""
    with serving() as (_, address), opened(browser, address) as page:
        figures = aim_about(page, options.seconds)
    return figures, ["round_trip_median"] * (figures["round_trip_median"] > MOST_ROUND_TRIP)


def frames(browser: Any, _: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """A break of 16 balls at the pace of the screen, and what the page computes for one frame."""
    with serving() as (_, address), opened(browser, address) as page:
        page.click("#shoot")
        until(page, "billiards.player.time > 0")
        times = page.evaluate(
            """() => new Promise((done) => {
                const times = [];
                const look = (now) => {
                    times.push(now);
                    if (now - times[0] < 5000) requestAnimationFrame(look);
                    else done(times);
                };
                requestAnimationFrame(look);
            })"""
        )
        page.click("[data-player=start]")
        costs = page.evaluate(
            """() => Array.from({ length: 500 }, (_, index) => {
                const { view, player, state } = billiards;
                const began = performance.now();
                view.clear();
                view.runAt(player.run, (index / 500) * player.run.end, state.table.balls, state.turning);
                return performance.now() - began;
            })"""
        )
    spacing = np.diff(times) / 1000.0
    figures = {
        "frames_per_second": float(1.0 / np.mean(spacing)),
        "spacing_p99": float(np.quantile(spacing, 0.99)),
        "script_a_frame_median": float(np.median(costs)) / 1000.0,
        "script_a_frame_p99": float(np.quantile(costs, 0.99)) / 1000.0,
    }
    return figures, []


def breaks(page: Page, seconds: float) -> None:
    """Break, and break again when the balls rest."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        page.click("#shoot")
        until(page, "billiards.player.shows")
        while time.monotonic() < deadline and page.evaluate("billiards.player.shows"):
            page.wait_for_timeout(50)
        page.click("#undo")
        until(page, "billiards.player.run === null")


def processor(browser: Any, options: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """What the server takes of a core with a page whose balls roll, and without a page."""
    with serving() as (server, address):
        with opened(browser, address) as page:
            page.mouse.move(0, 0)
            rolling = share(server.pid, options.seconds, lambda seconds: breaks(page, seconds))
        time.sleep(1.0)
        alone = share(server.pid, options.seconds, time.sleep)
    figures = {"rolling": rolling, "no_page": alone}
    return figures, [name for name, most in (("rolling", MOST_SHARE), ("no_page", 0.0)) if figures[name] > most]


def flood(browser: Any, options: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """Malformed, too long and foreign messages beside a page whose mouse moves."""
    with serving() as (server, address), opened(browser, address) as page:
        quiet = aim_about(page, options.seconds)
        before = memory(server.pid)
        port = int(address.rstrip("/").rpartition(":")[2])
        queue: Any = multiprocessing.get_context("spawn").Queue()
        arguments = (port, options.rate, options.seconds, queue)
        flooding = multiprocessing.get_context("spawn").Process(target=send_flood, args=arguments)
        flooding.start()
        queue.get()
        during = aim_about(page, options.seconds)
        highest = memory(server.pid)
        counts = queue.get(timeout=60.0)
        flooding.join(60.0)
        after = aim_about(page, 1.0)
        time.sleep(1.0)
        left = memory(server.pid)
    figures = {
        **counts,
        "memory_before": before,
        "memory_during": highest,
        "memory_after": left,
        "round_trip_before": quiet["round_trip_median"],
        "round_trip_during": during["round_trip_median"],
        "round_trip_after": after["round_trip_median"],
    }
    broken = ["memory"] * (max(highest, left) - before > MOST_GROWTH) + ["taken"] * (counts["taken"] > 0)
    return figures, broken


def ros(browser: Any, options: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """The page on a running table, each in a process of its own, in a ROS domain of this machine."""
    from billiards_sim.ros.process import end_group, isolate

    isolate(os.environ)
    table = subprocess.Popen(
        [sys.executable, "-m", "billiards_sim", "table"], stderr=subprocess.DEVNULL, start_new_session=True
    )
    with ExitStack() as stack:
        stack.callback(end_group, table)
        server, address = stack.enter_context(serving("--ros"))
        with opened(browser, address) as page:
            figures = aim_about(page, options.seconds)

            def roll(seconds: float) -> None:
                deadline = time.monotonic() + seconds
                page.click("#shoot")
                until(page, "billiards.state.rolling")
                while time.monotonic() < deadline and page.evaluate("billiards.state.rolling"):
                    page.wait_for_timeout(50)

            page.mouse.move(0, 0)
            page.evaluate("billiards.aim.setAll({ speed: 8.5, azimuth: 0.02 })")
            page.wait_for_timeout(200)
            figures["rolling"] = share(server.pid, 6.0, roll)
        time.sleep(1.0)
        figures["no_page"] = share(server.pid, options.seconds, time.sleep)
    return figures, [name for name in ("rolling", "no_page") if figures[name] > MOST_SHARE]


# ---- the flood, in a process of its own


def send_flood(port: int, rate: float, seconds: float, queue: Any) -> None:
    """A third each of malformed messages, of too long ones, and of requests of another site's page."""
    queue.put("ready")
    queue.put(asyncio.run(_send_flood(port, rate / 3.0, seconds)))


async def _send_flood(port: int, rate: float, seconds: float) -> dict[str, float]:
    flood, began = Flood(port), time.monotonic()
    await asyncio.gather(*(_evenly(send, rate, seconds) for send in (flood.malformed, flood.too_long, flood.foreign)))
    return {**flood.counts, "seconds": time.monotonic() - began}


async def _evenly(send: Callable[[], Coroutine[Any, Any, None]], rate: float, seconds: float) -> None:
    began = time.monotonic()
    under_way: set[asyncio.Task[None]] = set()
    for index in range(int(rate * seconds)):
        await asyncio.sleep(began + index / rate - time.monotonic())
        while len(under_way) >= 50:
            await asyncio.wait(under_way, return_when=asyncio.FIRST_COMPLETED)
        task = asyncio.create_task(send())
        under_way.add(task)
        task.add_done_callback(under_way.discard)
    if under_way:
        await asyncio.wait(under_way, timeout=10.0)


class Flood:
    """Sends what is to be refused, over bare sockets; `counts` tells how much of it, and what was not refused."""

    def __init__(self, port: int) -> None:
        self.counts = Counter(malformed=0, too_long=0, foreign=0, taken=0)
        self._port = port
        self._own = f"http://127.0.0.1:{port}"
        self._page: tuple[asyncio.Task[None], asyncio.StreamWriter] | None = None

    async def malformed(self) -> None:
        """A message that is no JSON, on one connection for all of them, whose answers are read."""
        if self._page is None:
            reader, writer, _ = await self._connected(self._own)
            self._page = asyncio.create_task(_read_away(reader)), writer
        self._page[1].write(_framed(b'{"do": "shoot", "shot": {"speed": [' + b"9" * 100))
        await self._page[1].drain()
        self.counts["malformed"] += 1

    async def too_long(self) -> None:
        """A message of more bytes than are taken, each on a connection of its own, until that is closed."""
        with suppress(ConnectionError):
            reader, writer, status = await self._connected(self._own)
            if status == "101":
                writer.write(_framed(b"x" * (MOST_BYTES + 1)))
                await _read_away(reader)
            writer.close()
        self.counts["too_long"] += 1

    async def foreign(self) -> None:
        """A connection from the page of another site."""
        with suppress(ConnectionError):
            _, writer, status = await self._connected("http://example.org")
            self.counts["taken"] += status != "403"
            writer.close()
        self.counts["foreign"] += 1

    async def _connected(self, origin: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, str]:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        writer.write(
            f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{self._port}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\n"
            "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
        )
        return reader, writer, (await reader.readline()).decode().split()[1]


def _framed(text: bytes) -> bytes:
    size = struct.pack("!BH", 0xFE, len(text)) if len(text) < 65536 else struct.pack("!BQ", 0xFF, len(text))
    return b"\x81" + size + bytes(4) + text  # masked by zeros


async def _read_away(reader: asyncio.StreamReader) -> None:
    with suppress(ConnectionError):
        while await reader.read(65536):
            pass


PARTS = {"start": start, "preview": preview, "frames": frames, "processor": processor, "flood": flood, "ros": ros}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)}; default all")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement")
    parser.add_argument("--rate", type=float, default=1000.0, help="of the flood, messages a second")
    options = parser.parse_args()
    bad = False
    with launched() as browser:
        for name in options.parts or PARTS:
            figures, broken = PARTS[name](browser, options)
            print(json.dumps({"part": name, **figures, "load": os.getloadavg()[0], "broken": broken}), flush=True)
            bad |= bool(broken)
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
