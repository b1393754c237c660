# SPDX-License-Identifier: Apache-2.0
"""`python3 -m billiards_sim NAME ...` runs the executable NAME, as `ros2 run billiards_sim NAME ...` does."""

from __future__ import annotations

import importlib
import os
import signal
import sys
from dataclasses import dataclass
from typing import Any

from billiards_sim.command_line import USAGE_ERROR


@dataclass(frozen=True)
class Executable:
    """Where an executable's `main(arguments) -> exit code` lives, and what it is for."""

    module: str
    help: str
    needs_ros: bool = False


EXECUTABLES = {
    "table": Executable("billiards_sim.ros.table_node", "the ROS 2 node: a table to shoot on", needs_ros=True),
    "shoot": Executable(
        "billiards_sim.ros.tools.shoot", "send the table a cue shot, print its verdict", needs_ros=True
    ),
    "demo": Executable("billiards_sim.ros.tools.demo", "break a rack over ROS 2 and print it", needs_ros=True),
    "simulate": Executable("billiards_sim.study.simulate", "run a scene without ROS: numbers, pictures, movies"),
    "benchmark": Executable("billiards_sim.study.benchmark", "measure speed against error"),
}


def run(name: str, arguments: list[str]) -> int:
    """Import the executable and call it; returns its exit code.

    Its module is imported only here, so that each executable needs only its own dependencies.
    """
    _leave_quietly_on_signals()
    executable = EXECUTABLES[name]
    try:
        main = importlib.import_module(executable.module).main
    except ImportError as error:
        # A module of this package that cannot be imported is a defect: that traceback must be seen.
        if not executable.needs_ros or (error.name or "").startswith("billiards_sim"):
            raise
        print(
            f"{name}: ROS 2 is not there ({error}): source your ROS installation, or pip install 'billiards_sim[ros]'",
            file=sys.stderr,
        )
        return USAGE_ERROR
    code: int = main(arguments)
    return code


def table() -> int:
    return run("table", sys.argv[1:])


def shoot() -> int:
    return run("shoot", sys.argv[1:])


def demo() -> int:
    return run("demo", sys.argv[1:])


def simulate() -> int:
    return run("simulate", sys.argv[1:])


def benchmark() -> int:
    return run("benchmark", sys.argv[1:])


def main() -> int:
    """Entry point of `python3 -m billiards_sim`."""
    names = ", ".join(EXECUTABLES)
    if len(sys.argv) < 2:
        print(f"billiards_sim: which executable? one of {names}", file=sys.stderr)
        return USAGE_ERROR
    name, *arguments = sys.argv[1:]
    if name in ("-h", "--help"):
        print("usage: python3 -m billiards_sim NAME [arguments]\n")
        for key, executable in EXECUTABLES.items():
            print(f"  {key:10} {executable.help}")
        print("\nNAME --help explains each.")
        return 0
    if name not in EXECUTABLES:
        print(f"billiards_sim: no executable {name!r}, choose one of {names}", file=sys.stderr)
        return USAGE_ERROR
    return run(name, arguments)


def _leave_quietly_on_signals() -> None:
    # Holds while modules load and kernels compile; what runs later installs its own handlers.
    def leave(*_: Any) -> None:
        sys.stdout.flush()
        os._exit(0)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, leave)


if __name__ == "__main__":
    sys.exit(main())
