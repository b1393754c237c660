# SPDX-License-Identifier: Apache-2.0
"""Tables of records, in the two forms that kernels take: listed for the interpreter, packed for machine code.

Kernels share tables in blocks: a named tuple of tables, as `kernels.state.State`. Listed, it is just that, and each
table is a list of objects. Packed, the tables lie one after the other in one piece of memory, which begins with where
each lies and how many rows it has, so that machine code needs the address alone; `packed.balls` is then a structured
array that looks into it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from itertools import chain, starmap
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

Row = TypeVar("Row")

SIZES = {float: np.float64, int: np.int64, bool: np.bool_}

WORD = 8
"""Bytes. What tables and records are aligned by, and one entry of the head of a packed block."""


class Layout(NamedTuple):
    """Where the tables of a packed block lie."""

    kind: Any
    head: bytes
    places: dict[str, tuple[np.dtype[Any], int, int]]  # type, number of rows and first byte of each table
    size: int  # bytes


class Packed:
    """A block in one piece of memory. Its tables are attributes, by the names that the block's kind gives them."""

    def __init__(self, layout: Layout, memory: NDArray[np.uint8]) -> None:
        self.layout = layout
        self.memory = memory

    def __getattr__(self, name: str) -> Any:
        # Only what is asked for is looked up, and that once.
        if name == "address":
            value: Any = self.memory.__array_interface__["data"][0]
        elif name in self.layout.places:
            value = np.frombuffer(self.memory, *self.layout.places[name])
        else:
            raise AttributeError(name)
        setattr(self, name, value)
        return value

    def __reduce__(self) -> tuple[Any, ...]:
        lengths = [rows for _, rows, _ in self.layout.places.values()]
        return _unpickled, (self.layout.kind, lengths, self.memory.tobytes())


def _unpickled(kind: Any, lengths: Sequence[int], memory: bytes) -> Packed:
    return Packed(layout(kind, *lengths), np.frombuffer(bytearray(memory), np.uint8))


@cache
def record_types(kind: Any) -> dict[str, Any]:
    """The kind of record in each table of a kind of block."""
    return {name: get_args(hint)[0] for name, hint in get_type_hints(kind).items()}


@cache
def record_layout(kind: Any) -> np.dtype[Any]:
    """The structured type of a record, a dataclass of floats, ints and bools."""
    hints = get_type_hints(kind)
    return np.dtype([(field.name, SIZES[hints[field.name]]) for field in fields(kind)], align=True)


@cache
def layout(kind: Any, *lengths: int) -> Layout:
    """Of a kind of block whose tables have so many rows, in the order of its fields."""
    at = 2 * WORD * len(lengths)
    head, places = [], {}
    for (name, record), rows in zip(record_types(kind).items(), lengths, strict=True):
        row = record_layout(record)
        places[name] = (row, rows, at)
        head += [at, rows]
        at += rows * row.itemsize
    return Layout(kind, np.array(head, np.int64).tobytes(), places, at)


def blank(kind: Any, packed: bool, **lengths: int) -> Any:
    """A block of records of zeros, with so many rows in each table."""
    if not packed:
        return kind(**{name: rows(record, lengths[name]) for name, record in record_types(kind).items()})
    return _blank(layout(kind, *(lengths[name] for name in record_types(kind))))


def _blank(where: Layout) -> Any:
    memory = np.zeros(where.size, np.uint8)
    memory[: len(where.head)] = np.frombuffer(where.head, np.uint8)
    return Packed(where, memory)


def copy_block(block: Any, scratch: Sequence[str] = ()) -> Any:
    """A block with the same values that shares nothing with this one; `scratch` are its last tables, left out."""
    if not isinstance(block, Packed):
        copies = {name: copy_rows(table) for name, table in block._asdict().items() if name not in scratch}
        return block._replace(
            **copies, **{name: rows(type(getattr(block, name)[0]), len(getattr(block, name))) for name in scratch}
        )
    if not scratch:
        return Packed(block.layout, block.memory.copy())
    kept = block.layout.places[scratch[0]][2]
    memory = np.empty(block.layout.size, np.uint8)
    memory[:kept] = block.memory[:kept]
    return Packed(block.layout, memory)


def in_form(block: Any, packed: bool, scratch: Sequence[str] = ()) -> Any:
    """The same block where it has that form, else one with the same values but for its last tables `scratch`."""
    if isinstance(block, Packed) == packed:
        return block
    if packed:
        tables = block._asdict()
        kind: Any = type(block)
        copy = _blank(layout(kind, *map(len, tables.values())))
        for name in tables.keys() - scratch:
            getattr(copy, name)[:] = [as_tuple(row) for row in tables[name]]
        return copy
    kept = {
        name: rows(kind, len(getattr(block, name)))
        if name in scratch
        else list(starmap(kind, getattr(block, name).tolist()))
        for name, kind in record_types(block.layout.kind).items()
    }
    return block.layout.kind(**kept)


def rows(kind: type[Row], count: int) -> list[Row]:
    """`count` records of zeros, listed."""
    return [kind() for _ in range(count)]


def copy_rows(table: Any) -> Any:
    """Records with the same values that share nothing with these."""
    if isinstance(table, np.ndarray):
        return np.frombuffer(bytearray(table.tobytes()), table.dtype)
    return [type(row)(*as_tuple(row)) for row in table]


def join_rows(kind: Any, tables: Sequence[Any]) -> Any:
    """The records of several tables, listed or packed, in one table, which shares nothing with them."""
    if not any(isinstance(table, np.ndarray) for table in tables):
        return copy_rows(list(chain.from_iterable(tables)))
    # As bytes: NumPy copies records field by field, which takes ten times longer.
    arrays = [_array(kind, table).tobytes() for table in tables]
    return np.frombuffer(bytearray(b"".join(arrays)), record_layout(kind))


def _array(kind: Any, table: Any) -> NDArray[Any]:
    if isinstance(table, np.ndarray):
        return table
    return np.array([as_tuple(row) for row in table], record_layout(kind))


def get_field(table: Sequence[Any], row: int, field: str) -> Any:
    """A value of a record as a Python number; many times faster than an attribute of a NumPy record."""
    return table[field].item(row) if isinstance(table, np.ndarray) else getattr(table[row], field)


def fill(table: Any, records: Sequence[Any]) -> None:
    """Give a table the values of as many records."""
    values = [as_tuple(record) for record in records]
    if isinstance(table, np.ndarray):
        table[:] = values
    else:
        table[:] = starmap(type(records[0]), values)


def set_fields(table: Sequence[Any], row: int, **values: float) -> None:
    """Give fields of a record values."""
    for field, value in values.items():
        if isinstance(table, np.ndarray):
            table[field][row] = value
        else:
            setattr(table[row], field, value)


def as_tuple(record: Any) -> tuple[Any, ...]:
    """The values of a record as Python numbers."""
    if isinstance(record, np.void):
        return tuple(record.item())
    kind: Any = type(record)
    return _values(kind)(record)


def columns(table: Sequence[Any], *names: str) -> NDArray[np.float64]:
    """(rows, fields) the values of some fields of records, a copy."""
    if isinstance(table, np.ndarray):
        numbers, indices = _numbers(table.dtype, names)
        words = table.view(numbers).reshape(len(table), -1)
        return np.asarray(words[:, indices], np.float64)
    return np.array([[getattr(row, name) for name in names] for row in table], np.float64).reshape(-1, len(names))


def column(table: Sequence[Any], name: str) -> NDArray[Any]:
    """(rows,) the values of a field of records, not to be written to."""
    return table[name] if isinstance(table, np.ndarray) else np.array([getattr(row, name) for row in table])


def set_columns(table: Sequence[Any], names: Sequence[str], values: NDArray[Any]) -> None:
    """Give some fields of records the values, (rows, fields)."""
    if isinstance(table, np.ndarray):
        for column, name in enumerate(names):
            table[name] = values[:, column]
    else:
        for row, numbers in zip(table, values.tolist()):
            for name, number in zip(names, numbers):
                setattr(row, name, number)


@cache
def _numbers(row: Any, names: tuple[str, ...]) -> tuple[Any, NDArray[np.intp]]:
    # The type of some fields of records, all of the same, and where they are among the words of a record.
    types = {row.fields[name][0] for name in names}
    (kind,) = types
    return kind, np.array([row.fields[name][1] // WORD for name in names])


@cache
def _values(kind: Any) -> Callable[[Any], tuple[Any, ...]]:
    names = [field.name for field in fields(kind)]
    if len(names) > 1:
        return attrgetter(*names)
    return lambda record: (getattr(record, names[0]),)
