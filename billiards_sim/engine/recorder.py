# SPDX-License-Identifier: Apache-2.0
"""Takes down every stretch of every ball's motion while the kernels run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from billiards_sim.engine.kernels.state import INF
from billiards_sim.engine.kernels.trajectory import Arc, Tape
from billiards_sim.engine.tables import Packed, blank, copy_rows, get_field, in_form, join_rows, set_columns, set_fields

SPOOL_ROWS = 4096
"""Stretches that the kernels write before they hand them over."""


def blank_tape(count: int, packed: bool) -> Tape:
    """A tape for so many balls; for none, one that nothing is written on."""
    tape = blank(Tape, packed, latest=count, arcs=SPOOL_ROWS + count if count else 0, spool=1)
    set_columns(tape.latest, ("time",), np.full((count, 1), -INF))
    return tape


class Recorder:
    """Takes down the arcs of a run, or of several that follow each other without a shot between.

    Args:
        count: number of balls.

    Attributes:
        epoch: time of the table, s, at which the kernels' clock was at 0, by which the arcs go.
    """

    def __init__(self, count: int) -> None:
        self.epoch = 0.0
        self._count = count
        self._tape: Tape | None = None
        self._unloaded: list[Sequence[Arc]] = []

    def tape(self, packed: bool) -> Tape:
        """What to write on, in this form."""
        if self._tape is None:
            self._tape = blank_tape(self._count, packed)
        elif isinstance(self._tape, Packed) != packed:
            self.unload()
            self._tape = in_form(self._tape, packed, ("arcs", "spool"))
        return self._tape

    def unload(self) -> None:
        """Make room on the tape."""
        if self._tape is None:
            return
        written = get_field(self._tape.spool, 0, "arcs")
        self._unloaded.append(copy_rows(self._tape.arcs[:written]))
        set_fields(self._tape.spool, 0, arcs=0)

    def arcs(self) -> Sequence[Arc]:
        """All arcs so far, in the order of their times."""
        self._unloaded = [join_rows(Arc, self._unloaded)]
        return self._unloaded[0]
