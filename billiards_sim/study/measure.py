# SPDX-License-Identifier: Apache-2.0
"""What every part of the benchmark measures with: clocks, medians, slopes, child processes, the machine."""

from __future__ import annotations

import gc
import importlib.metadata
import importlib.util
import json
import math
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from billiards_sim.engine.machine import is_ready

PACKAGE = Path(__file__).parents[1]

CHILD_TIMEOUT = 300.0
"""s, after which a child process is taken for stuck; the slowest compiles a peer's kernels for a minute."""


Task = tuple[str, Callable[[dict[str, Any]], None]]
"""A piece of the study: its name for the progress bar, and a function that adds its result to a part's figures."""


class ChildError(RuntimeError):
    """A child process failed; the text is the last line that it wrote."""


def spread(values: Sequence[float]) -> dict[str, Any]:
    """Median, smallest and largest of some values, and how many they are."""
    return {"median": float(np.median(values)), "low": min(values), "high": max(values), "runs": len(values)}


def seconds(action: Callable[[], Any]) -> float:
    """Wall time of one call, s."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def seconds_each(action: Callable[[], Any], runs: int, calls: int) -> list[float]:
    """Wall time of one call, s, `runs` times, each the mean of `calls` calls: for calls of microseconds."""
    action()
    gc.collect()
    return [seconds(lambda: [action() for _ in range(calls)]) / calls for _ in range(runs)]


def root_mean_square(values: Sequence[float]) -> float:
    """Root of the mean square; nan for no values."""
    return math.sqrt(math.fsum(value * value for value in values) / len(values)) if values else math.nan


def slope(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Slope of the straight line nearest to log y over log x, least squares, and its standard error.

    Of the error of a method over its step it is the order of the method.

    Raises:
        ValueError: fewer than three points.
    """
    if len(x) < 3:
        raise ValueError(f"a slope with its error needs three points, got {len(x)}")
    across, up = np.log(x) - np.log(x).mean(), np.log(y) - np.log(y).mean()
    spread_across = float(across @ across)
    found = float(across @ up) / spread_across
    rest = up - found * across
    return found, math.sqrt(float(rest @ rest) / (len(x) - 2) / spread_across)


def cost_at(level: float, costs: Sequence[float], errors: Sequence[float]) -> float | None:
    """The cost at which the error falls to a level, straight lines between the points in a log-log plot.

    Args:
        level: of the error.
        costs: in the order of ever finer methods.
        errors: that go with the costs; they may scatter.

    Returns:
        The cost where the last line falls through the level, beyond which no error exceeds it; the first cost if no
        error does; None if the last one does.
    """
    above = [index for index, error in enumerate(errors) if not error <= level]
    if not above:
        return costs[0]
    last = above[-1]
    if last == len(errors) - 1:
        return None
    if not math.isfinite(errors[last]):
        return costs[last + 1]
    share = math.log(errors[last] / level) / math.log(errors[last] / errors[last + 1])
    return math.exp(math.log(costs[last]) + share * math.log(costs[last + 1] / costs[last]))


def in_child(function: Callable[..., Any], environment: Mapping[str, str] | None = None, **arguments: Any) -> Any:
    """Call a function of this package in a new process; returns what it returned, through JSON.

    Raises:
        ChildError: it failed, or took longer than `CHILD_TIMEOUT`.
    """
    name = f"{function.__module__}:{function.__name__}"
    return json.loads(run_python("-m", "billiards_sim.study.child", name, json.dumps(arguments), **(environment or {})))


def run_python(*arguments: str, **environment: str) -> str:
    """Run this Python in a new process; returns the last line that it printed.

    Raises:
        ChildError: it failed, or took longer than `CHILD_TIMEOUT`.
    """
    return lines_of_python(*arguments, **environment)[-1]


def lines_of_python(*arguments: str, **environment: str) -> list[str]:
    """As `run_python`, every line that it printed."""
    try:
        child = subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=CHILD_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ChildError(f"no answer within {CHILD_TIMEOUT:g} s") from None
    lines = child.stdout.strip().splitlines()
    if child.returncode != 0 or not lines:
        said = child.stderr.strip().splitlines() or [f"exit code {child.returncode}"]
        raise ChildError(said[-1])
    return lines


def installed(module: str) -> bool:
    """Whether a module can be imported; it is not."""
    return importlib.util.find_spec(module) is not None


def version(distribution: str) -> str | None:
    """Of an installed package; None if it is not there."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return None


def machine() -> dict[str, Any]:
    """Where and with what the figures are made."""
    return {
        "cpu": _cpu_model(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "load": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": version("numba") if is_ready() else None,
        "billiards_sim": version("billiards_sim") or _version_of_source(),
        "commit": _commit(),
        "date": time.strftime("%Y-%m-%d", time.gmtime()),
    }


def _cpu_model() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _version_of_source() -> str | None:
    # Run from a checkout, nothing is installed: the package's manifest has it.
    manifest = PACKAGE.parent / "package.xml"
    if not manifest.is_file():
        return None
    return manifest.read_text(encoding="utf-8").partition("<version>")[2].partition("</version>")[0]


def _commit() -> str | None:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(PACKAGE), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")) != PACKAGE.parent.resolve():
            return None  # installed somewhere inside another repository
        return git("rev-parse", "--short=12", "HEAD") + (
            " with changes" if git("status", "--porcelain", "-uno") else ""
        )
    except (OSError, subprocess.CalledProcessError):
        return None
