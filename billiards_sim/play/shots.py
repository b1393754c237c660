# SPDX-License-Identifier: Apache-2.0
"""What pages ask for, read from their messages. What cannot be read raises `ValueError`, one line for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from billiards_sim.engine.aim import Aim
from billiards_sim.engine.quantity import number, shown
from billiards_sim.play.backend import Message

WORDS = ("speed", "azimuth", "side", "up", "elevation")
"""Of a shot, as `Aim` has them."""


def aim_of(shot: Message) -> tuple[Aim, str]:
    """A shot in people's words, and the ball that it hits."""
    unknown = [key for key in shot if key not in (*WORDS, "ball")]
    if unknown:
        raise ValueError(f"shot has no {shown(unknown[0])}; it has {', '.join(WORDS)} and ball")
    values = {name: number(f"shot.{name}", shot.get(name, 0.0)) for name in WORDS}
    ball = shot.get("ball", "cue")
    if not isinstance(ball, str):
        raise ValueError(f"shot.ball must be the name of a ball, got {shown(ball)}")
    return Aim(**values), ball


def mapping(asked: Message, key: str) -> Message:
    """A map of a message."""
    value = asked.get(key)
    if not isinstance(value, dict):
        raise ValueError(f"{key} must be a map of names to values, got {shown(value)}")
    return value


def choice(key: str, given: Any, known: Mapping[str, Any]) -> Any:
    """What a name of a message stands for."""
    if not isinstance(given, str) or given not in known:
        raise ValueError(f"{key} must be one of {', '.join(known)}, got {shown(given)}")
    return known[given]
