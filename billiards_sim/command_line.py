# SPDX-License-Identifier: Apache-2.0
"""What the executables share: how they take arguments, what they say, and how they end.

An executable raises an `Ending` wherever it cannot go on; `run_to_end` makes of it one line on stderr and an exit code.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import signal
import sys
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

USAGE_ERROR = 2
"""Exit code of a command that was called wrongly."""

FAILED = 1
"""Exit code of one that did not come to its end."""

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
"""What a terminal, a supervisor, a closed window and an impatient user send."""

LONGEST_LINE = 500
"""Characters of a line about a mistake: what was given can be long."""


class Ending(Exception):
    """Ends an executable; the text is one line for the user, or empty where there is nothing to say."""

    code = FAILED


class Refusal(Ending):
    """What was asked for cannot be done."""

    code = USAGE_ERROR


class Failure(Ending):
    """What was begun cannot go on."""


class Stopped(Ending):
    """A signal came that ends the process."""

    def __init__(self) -> None:
        super().__init__("stopped")


class Interrupt(KeyboardInterrupt):
    """A signal came, at any instant.

    A subclass, since `python3 -m` ends by SIGINT, whatever has handled the error, once a KeyboardInterrupt itself has
    passed through `exec`; dataclasses and named tuples are made with it.
    """


class Unheard(Ending):
    """Nobody reads stdout any more."""


class Parser(argparse.ArgumentParser):
    """An `ArgumentParser` whose errors are one line on stderr and exit code 2."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        # argparse takes -12deg and -1e-3 for options, and only -12 for a number. No option here starts with a digit.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        complain(self.prog, f"{message} (see {self.prog} --help)")
        self.exit(USAGE_ERROR)

    def _print_message(self, message: str, file: Any = None) -> None:
        say(message, end="")  # only helps come here


NO_ROS = "ROS 2 is not there ({error}): source your ROS installation, or pip install 'billiards_sim[ros]'"


@contextmanager
def needing(message: str) -> Iterator[None]:
    """Imports of what may not be installed; `{error}` in the message is what is missing.

    Raises:
        Refusal: with the message. A module of this package that cannot be imported is a defect, whose traceback must be
            seen.
    """
    try:
        yield
    except ImportError as error:
        if (error.name or "").startswith("billiards_sim"):
            raise
        raise Refusal(message.format(error=error)) from None


def positive_seconds(text: str) -> float:
    """An argument type: a finite time > 0, s."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise argparse.ArgumentTypeError(f"must be a finite number of seconds > 0, got {text}")
    return seconds


def run_to_end(program: str, play: Callable[[], int]) -> int:
    """Call what an executable does, which returns its exit code, and see to its end if it does not come to that.

    KeyboardInterrupt counts as `Stopped`.
    """
    try:
        return play()
    except Ending as ending:
        if str(ending):
            complain(program, ending)
        return ending.code
    except KeyboardInterrupt:
        complain(program, Stopped())
        return Stopped.code


def interrupt(*_: Any) -> NoReturn:
    """Handle a signal: ignore further ones, and raise `Interrupt`."""
    shut_out_signals()
    raise Interrupt


def interrupt_on_signals() -> None:
    """Let the first signal of `STOPPING` raise `Interrupt`, so that what is half done is cleared away."""
    for number in STOPPING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # by nohup
            signal.signal(number, interrupt)


def shut_out_signals() -> None:
    """From here on the process ends by itself; a second signal must not disturb it."""
    for number in STOPPING:
        signal.signal(number, signal.SIG_IGN)


def say(text: str, end: str = "\n") -> None:
    """Print to stdout, at once.

    Raises:
        Unheard: it is a pipe that nobody reads.
        Failure: it cannot be written for another reason, as a full disk.
    """
    try:
        print(text, end=end, flush=True)
    except BrokenPipeError:
        _give_up_stdout()
        raise Unheard from None
    except OSError as error:
        _give_up_stdout()
        raise Failure(f"cannot write to stdout: {error.strerror}") from None


def complain(program: str, said: object) -> None:
    """Print one line to stderr: who says it, and what. Without stderr there is nobody to tell."""
    if sys.stderr is not None:
        with suppress(OSError):
            print(f"{program}: {one_line(said)}", file=sys.stderr, flush=True)


def one_line(said: object) -> str:
    """A text, or that of an error, on one line and not too long; what cannot be printed is written as Python does."""
    line = " ".join(str(said).split())
    if len(line) > LONGEST_LINE:
        half = LONGEST_LINE // 2
        line = f"{line[:half]} ... {line[-half:]}"
    if line.isprintable():
        return line  # as most are: a table refuses thousands of shots a second
    return "".join(repr(one)[1:-1] if unicodedata.category(one) in ("Cc", "Cs") else one for one in line)


def _give_up_stdout() -> None:
    # What is left in its buffer would fail again when Python ends, with a line and an exit code of Python's own.
    with suppress(OSError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
