# SPDX-License-Identifier: Apache-2.0
"""The kernels that Python calls. They take blocks (named tuples of tables), floats and ints, as they are annotated."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .batch import play_batch
from .detection import contact_time, rail_contact_time
from .law.spin import last_spin_end
from .loop import run_until
from .orientation import turn_all, turn_along, turn_each
from .pocket import lay_down
from .strike import begin_anew, strike
from .trajectory import run_followed

ENTRIES: dict[str, Callable[..., Any]] = {
    entry.__name__: entry
    for entry in (
        run_until,
        run_followed,
        play_batch,
        strike,
        begin_anew,
        last_spin_end,
        lay_down,
        turn_all,
        turn_each,
        turn_along,
        contact_time,
        rail_contact_time,
    )
}
