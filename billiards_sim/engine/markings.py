# SPDX-License-Identifier: Apache-2.0
"""Spots and lines on the cloth, by the rules of the game that a table is for: what balls are placed by."""

from __future__ import annotations

import math

from billiards_sim.engine.pocket import Place
from billiards_sim.engine.table import Table

BAULK_LINE = 0.737
D_RADIUS = 0.292
BLACK_SPOT = 0.324
"""m. Of a snooker table: baulk line from the bottom cushion, the D, the black's spot from the top cushion (WPBSA)."""

START_SPOT = 0.1825
"""m. Of a carom table: from the head spot to those beside it (UMB)."""

ARC_STEPS = 48
"""Of the line that the D is drawn with."""


def spots(table: Table) -> dict[str, Place]:
    """The spots on a table, (x, y) m in the frame `table`, by name.

    On a full-size snooker table those of the colours (WPBSA, "Official rules"). Elsewhere head and foot spot (WPA); on
    a full-size carom table the centre and two beside the head spot, too (UMB, "World rules of carom billiard").
    """
    if _has_size_of(table, Table.snooker_12ft()):
        return snooker_spots(table)
    found = {"head": table.head_spot, "foot": table.foot_spot}
    if _has_size_of(table, Table.carom_10ft()):
        x, y = table.head_spot
        found |= {"centre": table.centre, "start_low": (x, y - START_SPOT), "start_high": (x, y + START_SPOT)}
    return found


def snooker_spots(table: Table) -> dict[str, Place]:
    """Those of the colours, by colour: yellow, green and brown on the baulk line, pink between blue and top cushion."""
    (middle_x, middle_y), baulk_x = table.centre, table.x_min + BAULK_LINE
    return {
        "yellow": (baulk_x, middle_y - D_RADIUS),
        "green": (baulk_x, middle_y + D_RADIUS),
        "brown": (baulk_x, middle_y),
        "blue": (middle_x, middle_y),
        "pink": (0.5 * (middle_x + table.x_max), middle_y),
        "black": (table.x_max - BLACK_SPOT, middle_y),
    }


def lines(table: Table) -> list[list[Place]]:
    """The lines on a table, each as the points (x, y) m that it leads through: for snooker baulk line and D."""
    if not _has_size_of(table, Table.snooker_12ft()):
        return []
    x, middle_y = table.x_min + BAULK_LINE, table.centre[1]
    angles = (math.pi * (0.5 + step / ARC_STEPS) for step in range(ARC_STEPS + 1))
    half_round = [(x + D_RADIUS * math.cos(angle), middle_y + D_RADIUS * math.sin(angle)) for angle in angles]
    return [[(x, table.y_min), (x, table.y_max)], half_round]


def _has_size_of(table: Table, game: Table) -> bool:
    # Whatever else was changed of it.
    return (table.length, table.width) == (game.length, game.width)
