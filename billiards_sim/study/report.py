# SPDX-License-Identifier: Apache-2.0
"""The benchmark's figures in words and tables: for the terminal, `benchmark.md` and the README."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from billiards_sim.files import written
from billiards_sim.study.chaos import APART, GOOD
from billiards_sim.study.precision import (
    CHART_TIME,
    EQUAL_ERROR,
    FIRST_ORDER_BELOW,
    NEIGHBOURS,
    QUICK_NEIGHBOURS,
    STEPPED,
)

BEGIN = "<!-- benchmark: what follows is written by `python3 -m billiards_sim benchmark --readme README.md` -->"
END = "<!-- benchmark: end -->"

WIDTH = 118
"""Characters in a line of text."""

HIGHLIGHTED_SCENES = ("head_on", "break")
"""The most forgiving and the most sensitive of the study."""

CROWD_TARGET = 3.0
"""How many times more an event may cost with the most balls than with the fewest."""

NODE_NOTE = """16 balls; the topics subscribed by another process of the same machine, the listener, whose own share of
a core is in the last column: where it is near 100% it is the listener that is late. Jitter: what 99% of the spacings
differ from the ideal one by, at most."""

ELASTIC_NOTE = """Racks of 15 balls hit at 8 m/s at four places, 2 ms later: the largest error of a component of a ball
that is not pressed then, the share of the energy that appeared or went (`-`: balls are pressed), and what 2 ms
cost. Errors are against the same law integrated by brute force (`test/data/make_elastic.py`), rigid or not."""

ROLLOUT_NOTE = """Shots a second of `bs.rollout`, to rest, medians: what the kernel alone allows, on one thread, and on
every core, measured in turn, so that the first ratio holds on a busy machine as well. Of another engine: breaks for
5 s, one after the other."""

ENVIRONMENT_NOTE = """Shots a second of environments with two balls, random actions, to rest; tables that step together
share a rollout on one thread. By the clock, which other programs slow down, and by the time that a core was spent on
it."""

BREAK_NOTE = """Breaks at 8 m/s with every effect of pool, aimed up to 14 mm beside the middle, to rest: the median over
aims of how far the median ball of the 15 ends from where it lay, and what a break costs. Racks 50 ms after the hit:"""

POOL_NOTE = """The break of the scene `nine_ball` from the velocity of the cue ball to rest, on a table of the same
figures, each engine with the physics that it comes with, here everything: elastic contacts, throw, cushions, spin that
falls. First events: what single balls meet first at the pockets, against a brute-force search with roots of 30
digits."""

Results = dict[str, Any]


class MarkerError(ValueError):
    """A file has no place for the report; the text names it."""


def figure(value: float | None) -> str:
    """A number with three significant digits, `-` for none."""
    if value is None:
        return "-"
    if value == 0.0:
        return "0"
    size = abs(value)
    if not 1e-3 <= size < 1e5:
        return f"{value:.1e}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")
    decimals = max(0, 2 - math.floor(math.log10(size)))
    return f"{value:.{decimals}f}"


def paragraph(text: str, indent: str = "") -> str:
    """Text in lines of `WIDTH`, the second and later ones indented."""
    return textwrap.fill(text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table with aligned columns, readable as it stands."""
    lines = [list(header), *map(list, rows)]
    widths = [max(3, *(len(line[column]) for line in lines)) for column in range(len(header))]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join("| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths)) + " |" for line in lines)


def where(results: Results) -> str:
    """Machine, versions and commit, one sentence."""
    machine, options = results["machine"], results["options"]
    numba = f"Numba {machine['numba']}" if machine["numba"] else "no Numba"
    cores = "1 core" if machine["cores"] == 1 else f"{machine['cores']} cores"
    return paragraph(
        f"{machine['cpu']}, {cores}, {machine['system']}, Python {machine['python']}, NumPy {machine['numpy']}, "
        f"{numba}, billiards_sim {machine['billiards_sim']} at {machine['commit'] or 'no commit'}, {machine['date']}; "
        f"load average {figure(machine['load'])} at the start; {options['seconds']:.0f} s"
        + (", quick: fewer runs than the full study." if options["quick"] else ".")
    )


def speed_table(rows: Sequence[dict[str, Any]]) -> str:
    """Median, smallest and largest, and the target where there is one."""
    return table(
        ("what", "median", "smallest", "largest", "unit", "runs", "target"),
        (
            (
                row["what"],
                *(figure(row[key]) for key in ("median", "low", "high")),
                row["unit"],
                str(row["runs"]),
                "" if row["target"] is None else f"<= {row['target']:g}: {_verdict(row['median'] <= row['target'])}",
            )
            for row in rows
        ),
    )


def crowd_table(crowds: Sequence[dict[str, Any]]) -> str:
    """Cost of events and memory by number of balls."""
    return table(
        ("balls", "us an event", "smallest", "largest", "runs", "events in 1 s", "set-up, ms", "memory, MB"),
        (
            (
                f"{crowd['balls']:,}".replace(",", " "),
                *(figure(crowd["per_event"][key] * 1e6) for key in ("median", "low", "high")),
                str(crowd["per_event"]["runs"]),
                str(crowd["events"]),
                figure(crowd["setup"]["median"] * 1e3),
                figure(crowd["bytes"] / 1e6),
            )
            for crowd in crowds
        ),
    )


def crowd_sentence(crowds: Sequence[dict[str, Any]]) -> str:
    """How the cost of an event grows from the fewest to the most balls."""
    few, most = crowds[0], crowds[-1]
    ratio = most["per_event"]["median"] / few["per_event"]["median"]
    return (
        f"An event among {most['balls']} balls costs {figure(ratio)} times one among {few['balls']} "
        f"(target <= {CROWD_TARGET:g}: {_verdict(ratio <= CROWD_TARGET)})."
    )


def rollout_table(study: dict[str, Any]) -> str:
    """Shots a second, and how much of what the kernel allows."""
    lines = []
    for case in study["cases"]:
        kernel, one, every = (case[way]["median"] for way in ("kernel", "one", "all"))
        rates = (figure(kernel), figure(one), figure(every))
        ratios = (figure(one / kernel), f"{figure(every / one)} on {case['threads']}")
        lines.append((case["name"], figure(case["events"]), *rates, *ratios))
    peer = study["peer"]
    rate = "not installed" if peer["absent"] else peer.get("failure") or figure(peer["rate"])
    lines.append((f"{peer['name']} {peer['version'] or ''}".strip() + ", `break` for 5 s", "", "", rate, "", "", ""))
    header = ("shots", "events each", "kernel, /s", "one thread, /s", "all cores, /s")
    return table((*header, "one thread over kernel", "all over one"), lines)


def environment_table(study: dict[str, Any]) -> str:
    """Shots a second of each environment."""
    if study["absent"]:
        return "Gymnasium is not installed."
    lines = [
        (
            f"`billiards_sim/{row['name']}-v0`",
            str(row["tables"]),
            *(figure(row["wall"][which]) for which in ("median", "low", "high")),
            figure(row["processor"]["median"]),
        )
        for row in study["rows"]
    ]
    header = ("environment", "tables", "shots a second", "least", "most", "a second of a core")
    return f"{table(header, lines)}\n\n{ENVIRONMENT_NOTE}"


def precision_summary(study: dict[str, Any]) -> str:
    """One line a scene: the error of each solver at `CHART_TIME`, and what the same error costs."""

    def line(name: str, scene: dict[str, Any]) -> tuple[str, ...]:
        event, paper = scene["event"], [point["position"][CHART_TIME] for point in scene["paper"]]
        reached = [error for error in paper if error is not None]
        return (
            f"`{name}`, {scene['balls']} balls",
            figure(event["position"][CHART_TIME]),
            figure(event["position"]["rest"]),
            figure(scene["rounding"]["rest"]),
            figure(event["wall"]["median"] * 1e6),
            f"{scene['order'][0]:.2f} +- {scene['order'][1]:.2f}" if scene["order"] else "-",
            figure(scene["ratio"]),
            figure(scene["ratio_interpreted"]),
            f"{figure(min(reached))} to {figure(max(reached))}" if reached else "-",
        )

    return table(
        (
            "scene",
            f"`event` at {CHART_TIME} s, m",
            "at rest, m",
            "rounding the start, m",
            "us a simulated second",
            "order of `time_step`",
            "its time over `event`'s",
            "without Numba",
            f"`paper` at {CHART_TIME} s, m",
        ),
        (line(name, scene) for name, scene in study.items()),
    )


def precision_notes(quick: bool) -> str:
    """What the columns of the summary mean."""
    neighbours = QUICK_NEIGHBOURS if quick else NEIGHBOURS
    low, high = neighbours[0] - 1.0, neighbours[-1] - 1.0
    return paragraph(
        "Errors are the largest of any ball. Rounding the start: how far the exact solution moves when the start is "
        "rounded to double precision, the least any solver in double precision can promise. Errors of `time_step` and "
        f"`paper` are root mean squares over {len(neighbours)} neighbouring steps ({low:+.0%} to {high:+.0%}), because "
        "they jump about with where in a step a collision falls. The order is the slope of the error over the step, "
        f"where it is under {FIRST_ORDER_BELOW * 100.0:g} cm and no collision is missed. Its time over `event`'s: wall "
        f"times at the same error of {EQUAL_ERROR * 1e3:g} mm, which `event` more than meets. `time_step` and `paper` "
        "are NumPy in Python; hence also the ratio to `event` without Numba. `paper`: smallest to largest error over "
        "all steps. `-`: not reached at any step."
    )


def precision_tables(study: dict[str, Any]) -> str:
    """Every point of the study."""
    texts = []
    for name, scene in study.items():
        lines = []
        points = [("event", scene["event"]), ("event, no Numba", scene["event_interpreted"])]
        points += [(f"{solver} {point['time_step']:g} s", point) for solver in STEPPED for point in scene[solver]]
        for label, point in points:
            wall = point["wall"] or {}
            energies = [share for share in point["energy"].values() if share is not None]
            lines.append(
                (
                    label,
                    *(figure(wall[key] * 1e3 if wall else None) for key in ("median", "low", "high")),
                    *(figure(error) for error in point["position"].values()),
                    figure(max(energies, default=None)),
                    f"{point['missed']}, {point['extra']}",
                    figure(point["overlap"]),
                    str(len(point["failures"])) if point["failures"] else "",
                )
            )
        times = [f"at {time} s" if time != "rest" else "at rest" for time in scene["event"]["position"]]
        header = ("solver", "ms a second", "smallest", "largest", *times)
        header += ("energy", "collisions missed, extra", "overlap, m", "runs failed")
        texts.append(
            f"### {name}\n\n{scene['description']}; {scene['balls']} balls, {scene['collisions']} collisions, at rest "
            f"after {figure(scene['rest_time'])} s. Position errors in m.\n\n{table(header, lines)}"
        )
    return "\n\n".join(texts)


def elastic_table(study: dict[str, Any]) -> str:
    """Error and cost of racks with elastic contacts, rigid ones beside them."""
    return table(
        (
            "gaps, mm",
            "contacts",
            "m/s",
            "m",
            "energy",
            "ms, median",
            "smallest",
            "largest",
        ),
        (
            (
                f"{point['gap'] * 1e3:g}",
                f"{point['steps']} steps" if point["steps"] else "rigid",
                figure(point["velocity"]),
                figure(point["position"]),
                figure(point["energy"]),
                *(figure(point["wall"][key] * 1e3) for key in ("median", "low", "high")),
            )
            for point in study["racks"]
        ),
    )


def break_table(study: dict[str, Any]) -> str:
    """How far breaks spread a rack, rigid beside elastic, and what they cost."""
    rows = {(point["gap"], point["elastic"]): point for point in study["breaks"]}
    gaps = sorted({gap for gap, _ in rows})
    return table(
        ("gaps, mm", "rigid, m", "elastic, m", "rigid, ms", "elastic, ms"),
        (
            (
                f"{gap * 1e3:g}",
                *(figure(rows[gap, is_elastic]["displacement"]["median"]) for is_elastic in (False, True)),
                *(figure(rows[gap, is_elastic]["wall"]["median"] * 1e3) for is_elastic in (False, True)),
            )
            for gap in gaps
        ),
    )


def chaos_table(study: dict[str, Any]) -> str:
    """How differences grow."""
    return table(
        (
            "what",
            "runs",
            "ball-ball collisions",
            "growth a collision",
            "growth by the end, median",
            "largest",
            "runs that the last bit moves by 1 mm",
            "earliest, s",
        ),
        (
            (
                name,
                str(part["seeds"]),
                figure(part["collisions_in_all"]),
                figure(part["per_collision"]),
                figure(part["at_end"]["median"]),
                figure(part["at_end"]["high"]),
                f"{part['parted']:.0%}",
                "never" if part["good_for"]["earliest"] is None else figure(part["good_for"]["earliest"]),
            )
            for name, part in study.items()
        ),
    )


def chaos_sentences(study: dict[str, Any]) -> str:
    """What the growth means for the user, one sentence an arrangement."""
    texts = []
    for name, part in study.items():
        growth, earliest = part["at_end"]["median"], part["good_for"]["earliest"]
        if earliest is None:
            trust = f"double precision is good to 1 mm until the last ball rests, in all {part['seeds']} runs"
        else:
            trust = (
                f"double precision is good to 1 mm for at least {figure(earliest)} s, and to the end in "
                f"{1.0 - part['parted']:.0%} of {part['seeds']} runs; beyond, a run is one of the possible outcomes, "
                "the same whenever it is run, and not the outcome"
            )
        felt = f"moving the first ball by {figure(GOOD / growth)} m moves where some ball ends by 1 mm in the median"
        texts.append(paragraph(f"- {name}: {trust}; {felt}.", indent="  "))
    return "\n".join(texts)


def peer_table(study: dict[str, Any]) -> str:
    """Time and error of other engines."""
    lines = []
    for name, peer in study.items():
        if peer["absent"]:
            lines.append((f"{name}: not installed", peer["kind"], "", "", "", "", "", ""))
            continue
        for scene, result in peer["scenes"].items():
            start = (f"{name} {peer['version'] or ''}".strip(), peer["kind"], scene)
            if "failure" in result:
                lines.append((*start, f"failed: {result['failure']}", "", "", "", ""))
                continue
            errors = (figure(error) for error in result["position"].values())
            lines.append((*start, figure(result["wall"]["median"] * 1e3), *errors))
    return table(("engine", "kind", "scene", "ms for 5 s", "error at 0.5 s, m", "1 s", "2 s", "5 s"), lines)


def pool_table(study: dict[str, Any]) -> str:
    """Time of a break on the pool table, and what single balls meet first."""
    lines = []
    ours = study.get("billiards_sim", {}).get("pool", {}).get("wall", {}).get("median")
    for name, peer in study.items():
        result = peer.get("pool")
        if result is None:
            continue
        what = f"{name} {peer['version'] or ''}".strip()
        if "failure" in result:
            lines.append((f"{what}: failed: {result['failure']}", *[""] * 8))
            continue
        wall, first = result["wall"], result["first_events"]
        lines.append(
            (
                what,
                *(figure(wall[key] * 1e3) for key in ("median", "low", "high")),
                str(wall["runs"]),
                figure(wall["median"] / ours) if ours else "-",
                str(result["events"]),
                str(result["pocketed"]),
                f"{first['right']} of {first['cases']}; {figure(first['error'])} s",
            )
        )
    header = ("engine", "ms, median", "smallest", "largest", "runs", "times ours", "events", "pocketed")
    return table((*header, "first events right; largest error"), lines)


def node_table(study: dict[str, Any]) -> str:
    """Load and evenness of the node."""
    if study.get("absent"):
        return "ROS 2 (rclpy) is not installed: not measured."
    runs = study.get("runs", [])
    columns: dict[str, Callable[[dict[str, Any]], str]] = {
        "Hz asked for": lambda run: f"{run['rate']}",
        "balls": lambda run: run["balls"],
        "Hz": lambda run: figure(run["mean_rate"]),
        "share of a core": lambda run: f"{run['load']:.0%}",
        "spacing of ticks, 1 %, ms": lambda run: _milliseconds(run["spacing_p1"]),
        "99 %, ms": lambda run: _milliseconds(run["spacing_p99"]),
        "subscribed": lambda run: run["topics"],
        "jitter, 99 %, ms": lambda run: _milliseconds(run["jitter_p99"]),
        "longest, ms": lambda run: _milliseconds(run["spacing_longest"]),
        "listener's share": lambda run: f"{run['listener_load']:.0%}",
    }
    lines = [tuple(column(run) for column in columns.values()) for run in runs]
    return "\n\n".join([table(tuple(columns), lines), *study.get("failures", []), NODE_NOTE])


def _milliseconds(seconds: float | None) -> str:
    return figure(None if seconds is None else seconds * 1e3)


def sections(results: Results) -> dict[str, str]:
    """The text of each part that was measured, by heading."""
    found = {}
    if speed := results.get("speed"):
        found["Speed"] = speed_table(speed["rows"])
        found["Many balls"] = f"{crowd_table(speed['crowds'])}\n\n{crowd_sentence(speed['crowds'])}"
        found["Cost of each feature"] = speed_table(speed["features"])
    if rollouts := results.get("rollouts"):
        found["Rollouts"] = f"{rollout_table(rollouts)}\n\n{ROLLOUT_NOTE}"
    if environments := results.get("environments"):
        found["Environments to learn in"] = environment_table(environments)
    if precision := results.get("precision"):
        notes = precision_notes(results["options"]["quick"])
        picture = "![Work and precision](work_precision.png)"
        found["Work and precision"] = f"{precision_summary(precision)}\n\n{notes}\n\n{picture}"
    if elastic := results.get("elastic"):
        picture = "![Racks 50 ms after the hit](rack.png)"
        found["Elastic contacts"] = "\n\n".join(
            (elastic_table(elastic), ELASTIC_NOTE, break_table(elastic), BREAK_NOTE, picture)
        )
    if chaos := results.get("chaos"):
        what = f"Growth is that of a difference of {figure(APART)} m in where the first ball starts."
        picture = "![Growth of a difference](chaos.png)"
        found["How far a run can be foretold"] = "\n\n".join(
            (chaos_table(chaos), chaos_sentences(chaos), what, picture)
        )
    if peers := results.get("peers"):
        found["Other engines"] = peer_table(peers)
        if any("pool" in peer for peer in peers.values()):
            found["A nine-ball break on a 9 ft pool table"] = f"{paragraph(POOL_NOTE)}\n\n{pool_table(peers)}"
    if node := results.get("node"):
        found["The node"] = node_table(node)
    return found


def whole_report(results: Results) -> str:
    """All tables: `benchmark.md`."""
    parts = ["# billiards_sim: speed against error", where(results)]
    parts += [f"## {heading}\n\n{text}" for heading, text in sections(results).items()]
    if results.get("precision"):
        parts.append(f"## Every solver, step and scene\n\n{precision_tables(results['precision'])}")
    return "\n\n".join(parts) + "\n"


def readme_fragment(results: Results) -> str:
    """What the README shows, between the markers: one short table."""
    return f"{table(('what', 'figure'), highlights(results))}\n\n{where(results)}"


def highlights(results: Results) -> list[tuple[str, str]]:
    """The few figures that tell most, of the parts that were measured: what, and the figure with its unit."""
    rows = [
        (row["what"], f"{figure(row['median'])} {row['unit']}")
        for row in results.get("speed", {}).get("rows", [])
        if row["target"] is not None and row["unit"] in ("ms", "s")
    ]
    for name, scene in results.get("precision", {}).items():
        if name in HIGHLIGHTED_SCENES:
            error, least = scene["event"]["position"]["rest"], scene["rounding"]["rest"]
            text = f"{figure(error)} m; rounding the start to double precision moves it by {figure(least)} m"
            rows.append((f"`{name}`, error at rest", text))
    for name, peer in results.get("peers", {}).items():
        result = peer.get("scenes", {}).get("break", {})
        if "position" in result:
            cost, error = figure(result["wall"]["median"] * 1e3), figure(result["position"][CHART_TIME])
            what = f"`break` for 5 s, {name} {peer['version'] or ''}".strip()
            rows.append((what, f"{cost} ms; error {error} m at {CHART_TIME} s"))
    for name, peer in results.get("peers", {}).items():
        result = peer.get("pool", {})
        if "wall" in result:
            what = f"nine-ball break, pool table, everything on, {name} {peer['version'] or ''}".strip()
            rows.append((what, f"{figure(result['wall']['median'] * 1e3)} ms"))
    for run in results.get("node", {}).get("runs", []):
        if run["topics"] == "all":
            what = f"node at {run['rate']} Hz, balls {run['balls']}, all topics subscribed"
            rows.append((what, f"{figure(run['mean_rate'])} Hz; {run['load']:.0%} of a core"))
    return rows


def with_fragment(text: str, fragment: str, name: str = "the file") -> str:
    """A text with a fragment in place of what stands between its markers.

    Raises:
        MarkerError: the markers are not there, once each and in order.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end or BEGIN in rest or END in after:
        raise MarkerError(f"{name} must have one line {BEGIN!r} and after it one line {END!r}")
    return f"{before}{BEGIN}\n\n{fragment}\n\n{END}{after}"


def write_readme(path: Path, results: Results) -> None:
    """Put the figures between the markers of a file.

    Raises:
        MarkerError: it has no markers.
        OSError: it cannot be read or written.
    """
    text = path.read_text(encoding="utf-8")
    whole = with_fragment(text, readme_fragment(results), str(path))
    with written(path) as file:
        file.write_text(whole, encoding="utf-8")


def _verdict(met: bool) -> str:
    return "met" if met else "missed"
