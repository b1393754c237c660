# SPDX-License-Identifier: Apache-2.0
"""`python3 -m billiards_sim NAME ...` runs the executable NAME, as `ros2 run billiards_sim NAME ...` does.

Nothing that takes time is imported before signals are taken care of.
"""

from __future__ import annotations

import os
import signal
import sys
from typing import Any, NamedTuple


class Executable(NamedTuple):
    """Where an executable's `main(arguments) -> exit code` lives, and what it is for."""

    module: str
    help: str
    needs_ros: bool = False
    stopped: int = 1
    """Exit code where a signal ends it."""


EXECUTABLES = {
    "table": Executable("billiards_sim.ros.table_node", "the ROS 2 node: a table to shoot on", True, stopped=0),
    "shoot": Executable("billiards_sim.ros.tools.shoot", "send the table a cue shot, print its verdict", True),
    "demo": Executable("billiards_sim.ros.tools.demo", "break a rack over ROS 2 and print it", True),
    "simulate": Executable("billiards_sim.study.simulate", "run a scene without ROS: numbers, pictures, movies"),
    "plan": Executable("billiards_sim.study.plan", "the best shots for a scene or a running table"),
    "play": Executable("billiards_sim.play.app", "a table in the browser: aim, preview, shoot", stopped=0),
    "benchmark": Executable("billiards_sim.study.benchmark", "measure speed against error"),
}


def run(name: str, arguments: list[str]) -> int:
    """Import the executable and call it; returns its exit code.

    Its module is imported only here, so that each executable needs only its own dependencies.
    """
    _leave_quietly_on_signals(name)
    from billiards_sim.command_line import run_to_end, shut_out_signals

    def to_end() -> int:
        code: int = _main_of(name, arguments)(arguments)
        shut_out_signals()
        return code

    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # names that a terminal cannot show
    return run_to_end(name, to_end)


def table() -> int:
    return run("table", sys.argv[1:])


def shoot() -> int:
    return run("shoot", sys.argv[1:])


def demo() -> int:
    return run("demo", sys.argv[1:])


def simulate() -> int:
    return run("simulate", sys.argv[1:])


def plan() -> int:
    return run("plan", sys.argv[1:])


def play() -> int:
    return run("play", sys.argv[1:])


def benchmark() -> int:
    return run("benchmark", sys.argv[1:])


def main() -> int:
    """Entry point of `python3 -m billiards_sim`."""
    name, *arguments = sys.argv[1:] or [""]
    if name in EXECUTABLES:
        return run(name, arguments)
    from billiards_sim.command_line import run_to_end

    return run_to_end("billiards_sim", lambda: _explain(name))


def _explain(name: str) -> int:
    from billiards_sim.command_line import Refusal, say

    names = ", ".join(EXECUTABLES)
    if not name:
        raise Refusal(f"which executable? one of {names}")
    if name not in ("-h", "--help"):
        raise Refusal(f"no executable {name!r}, choose one of {names}")
    lines = (f"  {key:10} {executable.help}" for key, executable in EXECUTABLES.items())
    say("\n".join(("usage: python3 -m billiards_sim NAME [arguments]\n", *lines, "\nNAME --help explains each.")))
    return 0


def _main_of(name: str, arguments: list[str]) -> Any:
    import importlib
    from contextlib import nullcontext

    from billiards_sim.command_line import NO_ROS, Refusal, needing

    for argument in arguments:
        try:
            argument.encode("utf-8")
        except UnicodeEncodeError:
            raise Refusal(f"arguments must be UTF-8, got {os.fsencode(argument)!r}") from None
    executable = EXECUTABLES[name]
    with needing(NO_ROS) if executable.needs_ros else nullcontext():
        return importlib.import_module(executable.module).main


def _leave_quietly_on_signals(name: str) -> None:
    # Holds while modules load; what runs later installs its own handlers.
    code = EXECUTABLES[name].stopped

    def leave(*_: Any) -> None:
        if code != 0:
            os.write(2, f"{name}: stopped\n".encode())
        os._exit(code)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        if signal.getsignal(number) is not signal.SIG_IGN:  # by nohup
            signal.signal(number, leave)


if __name__ == "__main__":
    sys.exit(main())
