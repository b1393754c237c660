# SPDX-License-Identifier: Apache-2.0
"""Physical quantities as dataclass fields: default, unit, bounds and help declared once.

`Physics` and `Table` are made of these fields. The scene file, the node's parameters and the table in docs/ros.md read
the same declarations, so a bound or a unit stands in one place only.
"""

from __future__ import annotations

import dataclasses
import math
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LONGEST_SHOWN = 100
"""Characters of a message that show what was given."""

MOST_LISTED = 30
"""Names in a message: all balls of a game of snooker."""


@dataclass(frozen=True)
class Quantity:
    """What is known of one field: its unit, its help and the closed or open interval it must lie in."""

    unit: str
    help: str
    above: float = -math.inf
    """exclusive lower bound"""
    minimum: float = -math.inf
    """inclusive lower bound"""
    maximum: float = math.inf
    """inclusive upper bound"""

    def bounds(self) -> str:
        """The interval in words, for messages and tables: `> 0`, `>= 0, <= 1`."""
        lower = f"> {self.above:g}" if self.above > -math.inf else f">= {self.minimum:g}"
        return f"{lower}, <= {self.maximum:g}" if self.maximum < math.inf else lower

    def contains(self, value: float) -> bool:
        return math.isfinite(value) and value > self.above and self.minimum <= value <= self.maximum


def quantity(default: float | None, unit: str, help: str, **bounds: float) -> Any:
    """A dataclass field that holds a `Quantity` with this default; None: it must be given."""
    metadata = {"quantity": Quantity(unit, help, **bounds)}
    return dataclasses.field(default=dataclasses.MISSING if default is None else default, metadata=metadata)


def quantities(owner: Any) -> dict[str, Quantity]:
    """The quantities of a dataclass (class or instance) by field name, in their order of declaration."""
    declared = {field.name: field.metadata.get("quantity") for field in dataclasses.fields(owner)}
    return {name: quantity for name, quantity in declared.items() if quantity is not None}


def part(kind: type) -> Any:
    """A dataclass field that holds a dataclass of quantities, by default none."""
    return dataclasses.field(default=None, metadata={"part": kind})


def parts(owner: Any) -> dict[str, Any]:
    """The kinds of the parts of a dataclass by field name."""
    declared = {field.name: field.metadata.get("part") for field in dataclasses.fields(owner)}
    return {name: kind for name, kind in declared.items() if kind is not None}


def check_quantities(owner: Any) -> None:
    """Turn every quantity of a frozen dataclass into a float and check its bounds, and the kinds of its parts.

    Raises:
        ValueError: a field is not a number, or lies outside its bounds.
    """
    group = type(owner).__name__.lower()
    for name, declared in quantities(owner).items():
        given = getattr(owner, name)
        value = _as_float(given)
        if value is None or not declared.contains(value):
            raise ValueError(
                f"{group}.{name} must be a number {declared.bounds()} ({declared.unit}), got {shown(given)}"
            )
        object.__setattr__(owner, name, value)
    for name, kind in parts(owner).items():
        value = getattr(owner, name)
        if not isinstance(value, (kind, type(None))):
            raise ValueError(f"{group}.{name} must be a {kind.__name__} or None, got {shown(value)}")


def from_mapping(owner: type, values: Any, presets: Mapping[str, Callable[..., Any]]) -> Any:
    """Build `Physics` or `Table` from a mapping; omitted keys keep their defaults, or the values of a preset.

    Args:
        values: the mapping; `preset` is the name of one. A name alone stands for the preset as it is. Parts are
            mappings, or null; their omitted keys keep the values of the preset, too.
        presets: what makes each of them, by name.

    Raises:
        ValueError: not a mapping, an unknown key or preset, or a value out of bounds.
    """
    group = owner.__name__.lower()
    if isinstance(values, str) and presets:
        values = {"preset": values}
    names = f" or one of the presets {', '.join(presets)}" if presets else ""
    _check_mapping(group, values, [*(["preset"] if presets else []), *quantities(owner), *parts(owner)], names)
    given = dict(values)
    make = preset(f"{group}.preset", given.pop("preset"), presets) if "preset" in given else owner
    for name in parts(owner).keys() & given.keys():
        given[name] = _part(owner, name, given[name], getattr(make(), name))
    return make(**given)


def _part(owner: type, name: str, values: Any, default: Any) -> Any:
    # Of `owner`, from a mapping.
    if values is None:
        return None
    kind, where = parts(owner)[name], f"{owner.__name__.lower()}.{name}"
    known = quantities(kind)
    _check_mapping(where, values, list(known), "")
    if default is not None:
        values = {**dataclasses.asdict(default), **values}
    missing = [key for key in known if key not in values]
    if missing:
        raise ValueError(f"{where} lacks {', '.join(missing)}")
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _check_mapping(where: str, values: Any, known: list[str], names: str) -> None:
    if not isinstance(values, dict):
        raise ValueError(f"{where} must be a mapping of names to numbers{names}, got {shown(values)}")
    for key in values:
        if key not in known:
            raise ValueError(f"{where} has no field {shown(key)}; known: {', '.join(known)}")


def preset(name: str, given: Any, presets: Mapping[str, Callable[..., Any]]) -> Callable[..., Any]:
    """What makes the preset that is asked for under a name.

    Raises:
        ValueError: there is none of that name.
    """
    if not isinstance(given, str) or given not in presets:
        raise ValueError(f"{name} must be one of {', '.join(presets)}, got {shown(given)}")
    return presets[given]


def number(name: str, given: Any) -> float:
    """A finite float from any real number.

    Raises:
        ValueError: not a number (a truth value, a text and a complex number are none), or not finite.
    """
    value = _as_float(given)
    if value is None or not math.isfinite(value):
        raise ValueError(f"{name} must be a finite number, got {shown(given)}")
    return value


def seconds(name: str, given: Any, least: float = 0.0, bound: str = "a finite number >= 0 (s)") -> float:
    """A time or a duration, s, that is no less than `least`; `bound` says so in words.

    Raises:
        ValueError: not a number as in `number`, not finite, or less.
    """
    value = _as_float(given)
    if value is None or not (math.isfinite(value) and value >= least):
        raise ValueError(f"{name} must be {bound}, got {shown(given)}")
    return value


def numbers(name: str, given: Any, count: int) -> tuple[float, ...]:
    """`count` floats from any sequence of real numbers, finite or not.

    Raises:
        ValueError: another number of them, or not numbers (truth values, texts and complex numbers are none).
    """
    try:
        values = [_as_float(value) for value in given]
    except TypeError:
        values = []
    floats = tuple(value for value in values if value is not None)
    if len(values) != count or len(floats) != count:
        raise ValueError(f"{name} must be {count} numbers, got {shown(given)}")
    return floats


def float_array(given: ArrayLike) -> NDArray[np.float64]:
    """A copy as an array of floats, finite or not.

    Raises:
        ValueError: a list of lists that is no array, or not numbers: NumPy would take truth values and texts for some,
            and leave out the imaginary part of complex ones.
    """
    if not (isinstance(given, np.ndarray) and given.dtype.kind in "fiu"):
        values = np.array(given, dtype=object).ravel().tolist()
        if not all(isinstance(value, Real) and not isinstance(value, bool) for value in values):
            raise ValueError(f"not an array of numbers: {shown(given)}")
    try:
        return np.array(given, dtype=np.float64)
    except (TypeError, OverflowError):
        raise ValueError(f"not an array of numbers: {shown(given)}") from None


def shown(given: Any) -> str:
    """What was given, for a message, on one line: its start, where it is long."""
    text = " ".join(repr(given).split())
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."


def listed(names: Sequence[str]) -> str:
    """Names for a message: the first ones, where there are many."""
    rest = len(names) - MOST_LISTED
    return ", ".join(names[:MOST_LISTED]) + (f" and {rest} more" if rest > 0 else "")


def is_text(given: str) -> bool:
    """Whether a text can be written anywhere and on one line: no control characters, line ends or half characters."""
    return not any(unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") for character in given)


def _as_float(given: Any) -> float | None:
    # None for what is no real number. A truth value is one to Python, and never what is meant.
    if type(given) is float:  # the others take ten times longer to tell
        return given
    if isinstance(given, bool) or not isinstance(given, Real):
        return None
    try:
        return float(given)
    except OverflowError:
        return math.inf
