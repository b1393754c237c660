# SPDX-License-Identifier: Apache-2.0
"""`benchmark`: speed against error, the whole study in one command.

Prints tables and writes `benchmark.json`, `benchmark.md` and pictures. `--from` makes the tables and pictures again
from a `benchmark.json`; `--readme` puts the few that tell most between the markers of a README.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from billiards_sim.command_line import Failure, Parser, Refusal, interrupt_on_signals, run_to_end, say
from billiards_sim.engine import machine as engine_machine
from billiards_sim.files import written
from billiards_sim.study import chaos, elastic, environments, node_cost, peers, precision, report, rollouts, speed
from billiards_sim.study.measure import ChildError, Task, machine

SEEDS = 200
QUICK_SEEDS = 50
CHAOS_SEEDS = 100
QUICK_CHAOS_SEEDS = 5

PARTS = ("speed", "rollouts", "environments", "precision", "elastic", "chaos", "peers", "node")
QUICK_PARTS = ("speed", "rollouts", "environments", "precision", "elastic", "chaos")


def main(arguments: list[str]) -> int:
    """Measure, print and write; returns the exit code."""
    interrupt_on_signals()
    return run_to_end("benchmark", lambda: _run(_parser().parse_args(arguments)))


def measure(parts: tuple[str, ...], quick: bool, seeds: int) -> dict[str, Any]:
    """The study's figures, with a progress bar on a terminal.

    Args:
        parts: of `PARTS`.
        quick: fewer runs, larger steps.
        seeds: breaks for the median times.

    Returns:
        "machine", "options", and one entry a part, as JSON can hold them: None where nothing was reached.
    """
    from tqdm import tqdm

    engine_machine.compile()
    start = time.perf_counter()
    results: dict[str, Any] = {"machine": machine(), "options": {"quick": quick, "seeds": seeds, "parts": list(parts)}}
    tasks = [(part, name, task) for part in parts for name, task in _tasks(part, quick, seeds)]
    with tqdm(tasks, disable=not sys.stderr.isatty(), unit="task") as bar:
        for part, name, task in bar:
            bar.set_description(name)
            task(results.setdefault(part, {}))
    results["options"]["seconds"] = time.perf_counter() - start
    return _without_nan(results)  # type: ignore[no-any-return]


def write(results: dict[str, Any], directory: Path) -> None:
    """Write `benchmark.json`, `benchmark.md` and the pictures.

    Raises:
        OSError: they cannot be written.
    """
    from billiards_sim.study import benchmark_plots

    directory.mkdir(parents=True, exist_ok=True)
    text = json.dumps(results, indent=1, allow_nan=False)
    with written(directory / "benchmark.json") as file:
        file.write_text(text + "\n", encoding="utf-8")
    with written(directory / "benchmark.md") as file:
        file.write_text(report.whole_report(results), encoding="utf-8")
    if results.get("precision"):
        with written(directory / "work_precision.png") as file:
            benchmark_plots.draw_work_precision(results["precision"], file)
    if results.get("elastic"):
        with written(directory / "rack.png") as file:
            benchmark_plots.draw_racks(results["elastic"]["pictures"], file)
    if results.get("chaos"):
        with written(directory / "chaos.png") as file:
            benchmark_plots.draw_chaos(results["chaos"], file)


def read(path: Path) -> dict[str, Any]:
    """Figures from a `benchmark.json`.

    Raises:
        OSError: it cannot be read.
        ValueError: it is not one.
    """
    results = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(results, dict) or not {"machine", "options"} <= results.keys():
        raise ValueError("no figures of a benchmark in it")
    return results


def _tasks(part: str, quick: bool, seeds: int) -> Iterator[Task]:
    if part == "speed":
        return speed.tasks(seeds, quick)
    if part == "rollouts":
        return rollouts.tasks(quick)
    if part == "environments":
        return environments.tasks(quick)
    if part == "precision":
        return precision.tasks(quick)
    if part == "elastic":
        return elastic.tasks(quick)
    if part == "chaos":
        return chaos.tasks(QUICK_CHAOS_SEEDS if quick else CHAOS_SEEDS)
    if part == "peers":
        return peers.tasks(quick)
    return node_cost.tasks()


def _run(options: argparse.Namespace) -> int:
    _check_installed()
    try:
        results = _results(options)
        say(report.whole_report(results))
        write(results, options.output)
        if options.readme:
            report.write_readme(options.readme, results)
    except KeyboardInterrupt:
        raise Failure("stopped; figures are written at the end only") from None
    except (OSError, report.MarkerError, ChildError) as error:
        raise Refusal(str(error)) from None
    print(f"benchmark: figures and pictures are in {options.output}", file=sys.stderr)
    return 0


def _check_installed() -> None:
    try:
        import matplotlib  # noqa: F401
        import tqdm  # noqa: F401
    except ImportError as error:
        raise Refusal(f"{error.name} is not there: pip install 'billiards_sim[plot]'") from None


def _results(options: argparse.Namespace) -> dict[str, Any]:
    if options.source:
        for option in ("quick", "seeds", "parts"):
            if getattr(options, option):
                raise Refusal(f"--from takes figures that were measured: leave out --{option}")
        try:
            return read(options.source)
        except ValueError as error:
            raise Refusal(f"{options.source}: {error}") from None
    parts = options.parts or (QUICK_PARTS if options.quick else PARTS)
    if options.seeds and "speed" not in parts:
        raise Refusal("--seeds needs the part speed")
    options.output.mkdir(parents=True, exist_ok=True)  # rather an error now than after the study
    return measure(tuple(parts), options.quick, options.seeds or (QUICK_SEEDS if options.quick else SEEDS))


def _parser() -> Parser:
    parser = Parser(prog="benchmark", description="Measure speed against error: tables, JSON, Markdown and pictures.")
    parser.add_argument("--quick", action="store_true", help="a minute in place of a quarter of an hour: fewer runs")
    parser.add_argument("--output", type=Path, default=Path("benchmark"), metavar="DIR", help="where to (benchmark)")
    parser.add_argument(
        "--seeds", type=_positive_whole, metavar="N", help=f"breaks for a median ({SEEDS}, quick {QUICK_SEEDS})"
    )
    parser.add_argument(
        "--parts",
        nargs="+",
        choices=PARTS,
        metavar="PART",
        help=f"only some of: {', '.join(PARTS)} (quick: the first {len(QUICK_PARTS)})",
    )
    parser.add_argument("--from", dest="source", type=Path, metavar="JSON", help="do not measure, take these figures")
    parser.add_argument(
        "--readme", type=Path, metavar="FILE", help="also put a short table between this file's markers"
    )
    return parser


def _positive_whole(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number >= 1, got {text}")
    return int(text)


def _without_nan(value: Any) -> Any:
    # JSON has no nan.
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(entry) for entry in value]
    return value
