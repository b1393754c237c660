# SPDX-License-Identifier: Apache-2.0
"""A run as a page in one file, which needs no server: the modules of the page one after the other, and the run."""

from __future__ import annotations

import json
import re
from pathlib import Path

from billiards_sim.engine.record import Run
from billiards_sim.play.records import run_record, table_record

PAGE = Path(__file__).parent / "page"

MODULES = ("motion.js", "balls.js", "view.js", "words.js", "player.js", "offline.js")
"""Each after those that it imports. What they name at their top is different, so that they make one module."""

PLAYER = ("<!-- player: also in pages of one file -->", "<!-- end of player -->")
"""What of the page is between these."""

MOST_ARCS = 200_000
"""Of all balls: some 50 MB. A break with everything on has two thousand."""


class TooLong(ValueError):
    """A run that no browser would open."""


def write_page(run: Run, path: Path, title: str) -> None:
    """Write a page that plays a run.

    Raises:
        TooLong: more than `MOST_ARCS` arcs.
        OSError: the file cannot be written.
    """
    arcs = sum(len(run.arcs(name)) for name in run.scene.names)
    if arcs > MOST_ARCS:
        raise TooLong(f"the run has {arcs} stretches of motion, a page takes {MOST_ARCS}: end it earlier with --until")
    data = json.dumps({"title": title, "table": table_record(run.scene), "run": run_record(run)}, allow_nan=False)
    parts = {
        "style.css": _text("style.css"),
        "player": _player(),
        "the run": data.replace("<", "\\u003c"),  # a name may have one, which would end the element
        "modules": "\n".join(_alone(_text(name)) for name in MODULES),
    }
    page = re.sub(r"/\* here: (.*?) \*/", lambda found: parts[found[1]], _text("offline.html"))
    path.write_text(page, encoding="utf-8")


def _text(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")


def _player() -> str:
    # Buttons, time line and events, as the page has them. What is for running tables alone is not shown.
    begin, end = PLAYER
    return _text("index.html").partition(begin)[2].partition(end)[0].strip("\n")


def _alone(module: str) -> str:
    # Without imports and exports.
    return re.sub(r"^export ", "", re.sub(r"^import .*;\n", "", module, flags=re.MULTILINE), flags=re.MULTILINE)
