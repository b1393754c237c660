# SPDX-License-Identifier: Apache-2.0
"""The executable `play`: a table in the browser."""

from __future__ import annotations

import argparse
import asyncio
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from billiards_sim.command_line import NO_ROS, STOPPING, Parser, Refusal, complain, needing, run_to_end, say
from billiards_sim.play.backend import Backend
from billiards_sim.scene_option import SCENE_HELP, scene_named

PORT = 8321

Serve = Callable[[Backend, int], tuple[Any, int]]

DESCRIPTION = """Open a table in the browser: aim with the mouse, see what would happen, shoot.
The page is served to this machine alone, until Ctrl-C. Exit code 0: stopped; 2: bad arguments, a port that is taken."""


def main(arguments: list[str]) -> int:
    """Serve until a signal comes; returns the exit code."""
    if _is_on_a_running_table(arguments):
        return run_to_end("play", lambda: _play_on_a_running_table(arguments))
    return run_to_end("play", lambda: _play(_parser().parse_args(arguments)))


def _is_on_a_running_table(arguments: list[str]) -> bool:
    if "--ros" in arguments:
        return True
    # `ros2 run` starts what lies in lib/billiards_sim
    if Path(sys.argv[0]).parent.parts[-2:] != ("lib", "billiards_sim"):
        return False
    own = arguments[: arguments.index("--ros-args")] if "--ros-args" in arguments else arguments
    return _parser().parse_args(own).scene is None


def _parser() -> Parser:
    parser = Parser(prog="play", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "scene",
        metavar="SCENE",
        nargs="?",
        help=f"{SCENE_HELP}; default eight_ball",
    )
    parser.add_argument(
        "--ros",
        action="store_true",
        help="play on the running table that listens on cue_shot; so does `ros2 run` without SCENE",
    )
    parser.add_argument("--port", type=_port, default=PORT, metavar="N", help=f"of 127.0.0.1 ({PORT}); 0: a free one")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    return parser


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"must be a whole number from 0 to 65535, got {text}")
    return int(text)


def _play(options: argparse.Namespace) -> int:
    from billiards_sim.play.engine_backend import EngineBackend

    try:
        backend = EngineBackend(scene_named(options.scene or "eight_ball"))
    except ValueError as error:
        raise Refusal(error) from None
    _serve(backend, options)
    return 0


def _play_on_a_running_table(arguments: list[str]) -> int:
    with needing(NO_ROS):
        from billiards_sim.play.ros_backend import RosBackend
        from billiards_sim.ros.process import own_arguments, ros
    options = _parser().parse_args(own_arguments("play", arguments))
    if options.scene is not None:
        raise Refusal(f"--ros plays on the scene of the running table: leave out --ros or {options.scene!r}")
    with ros("play", arguments):
        _serve(RosBackend(), options)
    return 0


def _serve(backend: Backend, options: argparse.Namespace) -> None:
    with needing("play needs tornado ({error}): pip install 'billiards_sim[play]'"):
        from billiards_sim.play.server import serve
    try:
        asyncio.run(_until_stopped(serve, backend, options))
    finally:
        backend.close()


async def _until_stopped(serve: Serve, backend: Backend, options: argparse.Namespace) -> None:
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in STOPPING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # by nohup
            loop.add_signal_handler(number, stopped.set)
    server, port = serve(backend, options.port)
    address = f"http://127.0.0.1:{port}/"
    say(f"play: {address} (Ctrl-C ends it)")
    if not options.no_browser:
        threading.Thread(target=_open, args=(address,), daemon=True).start()
    await stopped.wait()
    server.stop()


def _open(address: str) -> None:
    import webbrowser

    if not webbrowser.open(address):
        complain("play", f"no browser is found: open {address} in one")
