# SPDX-License-Identifier: Apache-2.0
"""Colours of the table and the balls, (red, green, blue) from 0 to 1, for whoever draws them."""

from __future__ import annotations

CLOTH = (0.04, 0.48, 0.58)
"""Tournament blue-green: every ball stands out from it, the green one and the blue one too."""

RUBBER = (0.03, 0.36, 0.44)
"""Of the cushions, under the same cloth in their own shade."""

WOOD = (0.35, 0.20, 0.10)
HOLE = (0.02, 0.02, 0.02)
MARKING = (0.90, 0.86, 0.76)
"""Of spots, lines and sights."""

CUE_BALL = (0.96, 0.95, 0.90)
WHITE = (0.98, 0.97, 0.94)
"""Of a striped ball beside its stripe, and of the disc under a number."""

DIGITS = "0123456789"
UNNUMBERED = (0.75, 0.75, 0.78)
NUMBERED = (
    (0.95, 0.77, 0.06),  # 1 and 9 yellow
    (0.10, 0.25, 0.70),  # 2 and 10 blue
    (0.80, 0.10, 0.10),  # 3 and 11 red
    (0.40, 0.15, 0.50),  # 4 and 12 purple
    (0.95, 0.45, 0.08),  # 5 and 13 orange
    (0.05, 0.45, 0.20),  # 6 and 14 green
    (0.50, 0.08, 0.12),  # 7 and 15 maroon
    (0.06, 0.06, 0.06),  # 8 black
)
"""Of the balls 1 to 8; 9 to 15 repeat 1 to 7."""

NAMED = {
    "cue": CUE_BALL,
    "white": CUE_BALL,
    "red": (0.76, 0.05, 0.08),
    "yellow": (0.95, 0.80, 0.10),
    "green": (0.02, 0.36, 0.12),
    "brown": (0.48, 0.24, 0.08),
    "blue": (0.12, 0.25, 0.75),
    "pink": (0.96, 0.55, 0.66),
    "black": (0.06, 0.06, 0.06),
}
"""Of the balls of snooker and carom billiards; reds are numbered."""

STRIPE = 0.5
"""Half the width of a stripe, in radii."""

DISC = 0.42
"""Radius of the white disc that bears the number, in radii."""


def ball_colour(name: str) -> tuple[float, float, float]:
    """Colour of a ball by its name: pool's for "1" to "15" and "cue", snooker's for "red1", "brown" and so on."""
    if is_plain(name):
        return NAMED[name.rstrip(DIGITS)]
    if name.isascii() and name.isdigit() and 1 <= int(name) <= 15:
        return NUMBERED[(int(name) - 1) % 8]
    return UNNUMBERED


def is_plain(name: str) -> bool:
    """Whether a ball's colour says which it is: it bears no number."""
    return name.rstrip(DIGITS) in NAMED


def is_striped(name: str) -> bool:
    """Whether a ball is a stripe, "9" to "15": white with a band of its colour."""
    return name.isascii() and name.isdigit() and 9 <= int(name) <= 15
