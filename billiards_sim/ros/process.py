# SPDX-License-Identifier: Apache-2.0
"""Start and end of ROS processes: arguments, signals, children."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from pathlib import Path

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation  # its exceptions have no public name
from rclpy.signals import SignalHandlerOptions, install_signal_handlers
from rclpy.utilities import remove_ros_args

from billiards_sim.command_line import STOPPING, Refusal, Stopped, interrupt, shut_out_signals

GRACE = 5.0
"""s that a child has to end after its signal, before it is killed."""

FASTDDS_PROFILES = Path(__file__).with_name("fastdds.xml")
"""See `announce_often`."""

FASTDDS_VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Environment variables that configure Fast DDS. The first is that of ROS 2 Jazzy, the second of later ones."""

LAST_DOMAIN = 101
"""ROS_DOMAIN_IDs 0 to 101 are safe on every operating system."""

HIGHEST_DOMAIN = 232
"""ROS_DOMAIN_ID of the last UDP ports there are. Beyond it Fast DDS ends the process."""


def own_arguments(program: str, arguments: list[str]) -> list[str]:
    """The arguments that are not ROS's own (`--ros-args ...`).

    Raises:
        Refusal: ROS arguments that rclpy refuses.
    """
    with _start_errors():
        return list(remove_ros_args([program, *arguments])[1:])


@contextmanager
def ros(program: str, arguments: list[str]) -> Iterator[None]:
    """ROS communication while the block runs.

    Signals are left alone until `stoppable`.

    Raises:
        Refusal: ROS arguments or environment variables that rclpy or the middleware refuse.
    """
    _check_domain(os.environ.get("ROS_DOMAIN_ID", ""))
    with _start_errors():
        rclpy.init(args=[program, *arguments], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        shut_out_signals()
        rclpy.try_shutdown()


@contextmanager
def stoppable() -> Iterator[None]:
    """SIGINT and SIGTERM end the block, also where an executor spins in it.

    Raises:
        Stopped: one of them came. Further ones are ignored.
    """
    # rclpy's handlers call the ones that were there before: these must not end the process by themselves.
    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    install_signal_handlers(SignalHandlerOptions.ALL)
    try:
        yield
    except (KeyboardInterrupt, ExternalShutdownException):
        shut_out_signals()
        raise Stopped from None
    except Exception:
        # SIGTERM shuts ROS down under whatever runs: then that fails in ways of its own.
        if rclpy.ok():
            raise
        shut_out_signals()
        raise Stopped from None


@contextmanager
def noted_signals() -> Iterator[list[int]]:
    """The signals of `STOPPING` that have come, in a list that grows; they interrupt nothing.

    For whoever starts processes, and looks at the list between its steps: an exception in the middle of a start would
    leave the new process to itself. What is ignored already (by nohup) stays so.
    """
    came: list[int] = []
    for number in STOPPING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda given, _: came.append(given))
    yield came


def claim_domain(start: int, taken: str | None = None) -> tuple[int, socket.socket]:
    """A ROS domain that nobody has claimed on this machine, and what claims it until it is closed.

    The claim is an abstract address (Linux): no file, and free again however the process ends.

    Args:
        start: where to begin to look.
        taken: a domain that is not to be had.

    Raises:
        Refusal: there is none.
    """
    for number in range(start, start + LAST_DOMAIN):
        domain = 1 + number % LAST_DOMAIN
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            claim.bind(f"\0billiards_sim ROS domain {domain}")
        except OSError:
            claim.close()
            continue
        if str(domain) != taken:
            return domain, claim
        claim.close()
    raise Refusal("no ROS domain is free")


def isolate(environment: MutableMapping[str, str]) -> None:
    """Keep traffic on this machine, until this process ends, in a domain that nobody else has, nor the user.

    Raises:
        Refusal: there is none.
    """
    domain, claim = claim_domain(os.getpid(), environment.get("ROS_DOMAIN_ID"))
    claim.detach()  # stays open
    environment["ROS_DOMAIN_ID"] = str(domain)
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


def announce_often(environment: MutableMapping[str, str]) -> None:
    """Let late joiners find this process within a second, where Fast DDS is used and nobody configured it.

    Two processes that miss each other's first announcements find each other with the next one. By default that comes
    after 3 s, and until then a late joiner lacks what is latched.
    """
    if not any(name in environment for name in FASTDDS_VARIABLES):
        environment[FASTDDS_VARIABLES[0]] = str(FASTDDS_PROFILES)


def end_group(process: subprocess.Popen[bytes], grace: float = GRACE) -> None:
    """End a process, which leads a group of its own, and all of that group, unless it has ended itself.

    Args:
        grace: s from SIGTERM to SIGKILL. SIGTERM, since a Python that has just started answers SIGINT with a traceback.
    """
    if process.poll() is not None:
        return
    os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(grace)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


class Child:
    """A process of this package in its own process group, ended with the block; the parent is then expected to end."""

    def __init__(self, *arguments: str) -> None:
        self._process = subprocess.Popen([sys.executable, "-m", "billiards_sim", *arguments], start_new_session=True)

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *_: object) -> None:
        if self.exit_code is not None:
            return
        shut_out_signals()
        end_group(self._process)

    @property
    def pid(self) -> int:
        """Of the process, and of its group."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """None while it runs."""
        return self._process.poll()


def _check_domain(domain: str) -> None:
    # What is no number rclpy refuses by itself.
    if domain.lstrip("-").isdecimal() and not (len(domain) <= 3 and 0 <= int(domain) <= HIGHEST_DOMAIN):
        raise Refusal(f"ROS_DOMAIN_ID must be 0 to {HIGHEST_DOMAIN}, got {domain}")


@contextmanager
def _start_errors() -> Iterator[None]:
    try:
        yield
    except rclpy_implementation.UnknownROSArgsError as error:
        raise Refusal(f"unknown ROS arguments: {error}") from None
    except (rclpy_implementation.RCLError, rclpy_implementation.RCLInvalidROSArgsError) as error:
        text = str(error).partition(", at /")[0]  # the rest names places in rcl's own sources
        raise Refusal(text) from None
