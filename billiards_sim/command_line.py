# SPDX-License-Identifier: Apache-2.0
"""What the executables share: a parser that answers a mistake with one line."""

from __future__ import annotations

import argparse
import math
import re
from typing import Any, NoReturn

USAGE_ERROR = 2
"""Exit code of a command that was called wrongly."""


class Parser(argparse.ArgumentParser):
    """An `ArgumentParser` whose errors are one line on stderr and exit code 2."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        # argparse takes -12deg and -1e-3 for options, and only -12 for a number. No option here starts with a digit.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        self.exit(USAGE_ERROR, f"{self.prog}: {message} (see {self.prog} --help)\n")


def positive_seconds(text: str) -> float:
    """An argument type: a finite time > 0, s."""
    seconds = float(text)
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise argparse.ArgumentTypeError(f"must be a finite number of seconds > 0, got {text}")
    return seconds
