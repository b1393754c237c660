# SPDX-License-Identifier: Apache-2.0
"""The server: a page, and a WebSocket for each page that is open. It speaks with this machine alone.

Whoever asks must do so under a name of this machine: a site that makes its own name point here (DNS rebinding) is
refused by the Host header, a page of another site by the Origin header. What a page may send is bounded in size and
rate. Each answer is written before the next message is read, so that a page that does not read fills no memory.
"""

from __future__ import annotations

import json
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import tornado.httpserver
import tornado.ioloop
import tornado.netutil
import tornado.web
import tornado.websocket

from billiards_sim.command_line import Refusal, one_line
from billiards_sim.engine.quantity import shown
from billiards_sim.play.backend import Backend, Message

ADDRESS = "127.0.0.1"
NAMES = ("127.0.0.1", "localhost", "[::1]")
"""Of this machine. The port is left open, for those who forward one."""

PAGE = Path(__file__).parent / "page"

MOST_BYTES = 200_000
"""Of a message: scene files of a hundred balls. Tornado closes the connection of a longer one."""

MOST_PAGES = 20

RATE = 100.0
"""Messages a second that a page may send in the long run; a mouse that moves makes 60."""

BURST = 200.0
"""Messages at once."""

MOST_UNREAD = 200
"""Messages for all that a page may leave unread before it is closed."""

SILENCE = 1.0
"""s between two complaints of too many messages."""

POLICY = "default-src 'self'; img-src 'self' data: blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
"""Nothing is loaded from elsewhere, and nobody shows the page within theirs."""


class Allowance:
    """How much of a rate is left: so many at once, and so many a second after that."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._left, self._at = BURST, clock()

    def take(self) -> bool:
        """Take one; whether there was one."""
        now = self._clock()
        self._left = min(self._left + RATE * (now - self._at), BURST)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def is_own_name(host: str) -> bool:
    """Whether a Host header names this machine."""
    name, _, port = host.rpartition(":") if not host.endswith("]") and ":" in host else (host, "", "")
    return name in NAMES and (not port or port.isdigit())


class _Guarded(tornado.web.RequestHandler):
    def prepare(self) -> None:
        if not is_own_name(self.request.host):
            self.set_status(403)
            self.finish(f"this table is at {ADDRESS}, not at {shown(self.request.host)}\n")

    def set_default_headers(self) -> None:
        self.set_header("Content-Security-Policy", POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-cache")


class _Files(_Guarded, tornado.web.StaticFileHandler):
    pass


class _Pages:
    """The pages that are open."""

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        self.all: set[_Socket] = set()
        backend.tell = self.tell

    def tell(self, message: Message) -> None:
        """Tell every page, once for all."""
        text = json.dumps(message, allow_nan=False)
        for page in list(self.all):
            page.tell(text)


class _Socket(_Guarded, tornado.websocket.WebSocketHandler):
    def initialize(self, pages: _Pages) -> None:
        self._pages = pages
        self._allowance = Allowance()
        self._complained = -SILENCE
        self._unread = 0
        self._waiting: Message | None = None  # the latest preview that was asked for
        self._answers = False

    def check_origin(self, origin: str) -> bool:
        return urlsplit(origin).netloc == self.request.host

    async def open(self, *_: str, **__: str) -> None:
        if len(self._pages.all) >= MOST_PAGES:
            self.close(1013, f"{MOST_PAGES} pages are open already")
            return
        for message in self._pages.backend.greeting():
            self.tell(json.dumps(message, allow_nan=False))
        self._pages.all.add(self)  # what is told from now on comes after the greeting
        self._pages.backend.attend(len(self._pages.all))

    def on_close(self) -> None:
        if self in self._pages.all:
            self._pages.all.remove(self)
            self._pages.backend.attend(len(self._pages.all))

    async def on_message(self, message: str | bytes) -> None:
        if not self._allowance.take():
            if time.monotonic() - self._complained >= SILENCE:
                self._complained = time.monotonic()
                await self._send({"error": f"more than {RATE:g} messages a second: the rest is dropped"})
            return
        asked: Message = {}
        try:
            asked = _read(message)
            if asked.get("do") == "preview":
                await self._answer_later(asked)
            else:
                await self._send({"id": asked.get("id"), **await self._pages.backend.answer(asked)})
        except ValueError as error:
            await self._send({"id": asked.get("id"), "error": one_line(error)})

    def tell(self, text: str) -> None:
        """What every page is told."""
        if self._unread >= MOST_UNREAD:
            self.close(1008, "the page does not read")
            self.on_close()  # without waiting for its farewell
            return
        try:
            written = self.write_message(text)  # before the answer to whom it changed the table for
        except tornado.websocket.WebSocketClosedError:
            return
        self._unread += 1
        tornado.ioloop.IOLoop.current().add_callback(self._count, written)

    async def _count(self, written: Awaitable[None]) -> None:
        with suppress(tornado.websocket.WebSocketClosedError, tornado.iostream.StreamClosedError):
            await written
        self._unread -= 1

    async def _answer_later(self, asked: Message) -> None:
        # The latest wins: those that come while one is worked on replace each other.
        dropped, self._waiting = self._waiting, asked
        if dropped is not None:
            await self._send({"id": dropped.get("id"), "dropped": True})
        if not self._answers:
            self._answers = True
            tornado.ioloop.IOLoop.current().add_callback(self._answer_previews)

    async def _answer_previews(self) -> None:
        try:
            while self._waiting is not None:
                asked, self._waiting = self._waiting, None
                try:
                    answer = await self._pages.backend.answer(asked)
                except ValueError as error:
                    answer = {"error": one_line(error)}
                await self._send({"id": asked.get("id"), **answer})
        finally:
            self._answers = False

    async def _send(self, message: Message) -> None:
        with suppress(tornado.websocket.WebSocketClosedError, tornado.iostream.StreamClosedError):
            await self.write_message(json.dumps(message, allow_nan=False))


def serve(backend: Backend, port: int) -> tuple[tornado.httpserver.HTTPServer, int]:
    """Listen on this machine alone; returns the server and its port.

    Args:
        port: 0 takes any that is free.

    Raises:
        Refusal: the port is taken, or cannot be had.
    """
    pages = _Pages(backend)
    application = tornado.web.Application(
        [
            (r"/socket", _Socket, {"pages": pages}),
            (r"/(.*)", _Files, {"path": str(PAGE), "default_filename": "index.html"}),
        ],
        websocket_max_message_size=MOST_BYTES,
        websocket_ping_interval=30.0,
        websocket_ping_timeout=30.0,
        log_function=lambda _: None,
    )
    try:
        (socket,) = tornado.netutil.bind_sockets(port, ADDRESS)
    except OSError as error:
        raise Refusal(f"port {port} cannot be had ({error.strerror}): name another one with --port") from None
    server = tornado.httpserver.HTTPServer(application, max_header_size=16_384, max_body_size=1024)
    server.add_sockets([socket])
    return server, socket.getsockname()[1]


def _read(message: str | bytes) -> Message:
    # Of JSON, what is plain: a map.
    if not isinstance(message, str):
        raise ValueError("a message must be text, got bytes")
    try:
        asked = json.loads(message)
    except (ValueError, RecursionError):
        raise ValueError(f"a message must be JSON, got {shown(message)}") from None
    if not isinstance(asked, dict):
        raise ValueError(f"a message must be a JSON map, got {shown(asked)}")
    identity = asked.get("id")
    if not isinstance(identity, (int, type(None))):
        raise ValueError(f"id must be a whole number, got {shown(identity)}")
    return asked
