# SPDX-License-Identifier: Apache-2.0
"""One source, two speeds: kernels that Numba compiles where it is installed and Python interprets where it is not.

A kernel is a plain function over numbers and tables of records. A table is a structured NumPy array when kernels are
compiled and a list of objects when they are interpreted, because Python reads an attribute many times faster than an
array element. Kernels write `table[row].field` for both; both give the same bits.

Numba's own switch `NUMBA_DISABLE_JIT=1` selects interpretation where Numba is installed.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
Row = TypeVar("Row")
try:
    import numba
except ImportError:
    COMPILED = False
else:
    COMPILED = not numba.config.DISABLE_JIT  # type: ignore[attr-defined]


def kernel(function: Kernel) -> Kernel:
    """A function that kernels call: compiled into its callers."""
    return _compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True) if COMPILED else function


def entry(function: Kernel) -> Kernel:
    """A kernel that Python calls: compiled on its first call, the machine code kept on disk for the next process."""
    if not COMPILED:
        return function
    if CACHE is None:
        return _compiled(function)
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(CACHE)  # type: ignore[attr-defined]
    try:
        return _compiled(function, cache=True)
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


def _compiled(function: Kernel, **options: Any) -> Any:
    njit: Any = numba.njit  # its type stubs do not know every option
    # Kernels allocate nothing. Without the counting of references to arrays they run a quarter faster.
    return njit(_nrt=False, **options)(function)


def _cache_folder() -> Path | None:
    # Numba compiles an entry again when its own file changes or the processor is another, but not when a kernel changes
    # that it calls. So each content of the sources has a folder of its own; None if none can be written. Those of
    # former contents go.
    here = Path(__file__).parent
    installed = _digest(str(here), sys.version, numba.__version__, np.__version__)
    name = f"billiards_sim-{installed}-{_digest(*(path.read_bytes() for path in sorted(here.glob('*.py'))))}"
    given: str = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    of_user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    parents = [Path(given)] if given else []
    parents += [here / "__pycache__"] + [Path(of_user)] * os.path.isabs(of_user)
    for parent in parents:
        folder = parent.absolute() / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        for former in parent.glob(f"billiards_sim-{installed}-*"):
            if former != folder:
                shutil.rmtree(former, ignore_errors=True)
        return folder
    return None


def _digest(*parts: str | bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        digest.update(b"%d " % len(content) + content)
    return digest.hexdigest()[:16]


def _announce_compiling() -> None:
    # Numba tells of a compilation only when the cache does not hold its result.
    event: Any = importlib.import_module("numba.core.event")
    future = "it is kept for the next time"
    if CACHE is None:
        future = "it cannot be kept, no cache directory can be written: NUMBA_CACHE_DIR may name one"

    class Announcer(event.Listener):  # type: ignore[misc]
        def on_start(self, compilation: Any) -> None:
            if compilation.data["dispatcher"].py_func.__module__.startswith(__package__):
                event.unregister("numba:compile", self)
                print(f"billiards_sim: compiling the engine, about 10 s; {future}", file=sys.stderr)

        def on_end(self, compilation: Any) -> None:
            pass

    event.register("numba:compile", Announcer())


CACHE = _cache_folder() if COMPILED else None
if COMPILED:
    _announce_compiling()


def rows(kind: type[Row], count: int) -> Sequence[Row]:
    """`count` records of zeros, each with the fields of a dataclass of floats, ints and bools."""
    if not COMPILED:
        return [kind() for _ in range(count)]
    layout = _layout(kind)  # type: ignore[arg-type]
    return np.frombuffer(bytearray(count * layout.itemsize), layout)  # type: ignore[return-value]


def join_rows(tables: Sequence[Any]) -> Any:
    """The records of several tables in one table, which shares nothing with them."""
    if not COMPILED:
        return [type(row)(*as_tuple(row)) for row in chain.from_iterable(tables)]
    # As bytes: NumPy copies records field by field, which takes ten times longer.
    return np.frombuffer(bytearray(b"".join(table.tobytes() for table in tables)), tables[0].dtype)


def copy_rows(table: Any) -> Any:
    """Records with the same values that share nothing with these."""
    return join_rows([table])


def as_rows(kind: type[Row], table: Any) -> Sequence[Row]:
    """A copy of a table that may come from a process where the kernels were compiled and here are not, or reversely."""
    values = table.tolist() if isinstance(table, np.ndarray) else [_values(kind)(row) for row in table]  # type: ignore[arg-type]
    if not COMPILED:
        return [kind(*row) for row in values]
    copy = rows(kind, len(values))
    copy[:] = values  # type: ignore[index]
    return copy


def take_rows(table: Any, indices: NDArray[np.intp]) -> Any:
    """Copies of the records with these indices, (rows,), which may repeat."""
    return table[indices] if COMPILED else copy_rows([table[index] for index in indices.tolist()])


def table_of(record: Row) -> Sequence[Row]:
    """A table of one record with the values of this one."""
    if not COMPILED:
        return [record]
    table = rows(type(record), 1)
    table[0] = _values(type(record))(record)  # type: ignore[index, arg-type]
    return table


def get_field(table: Sequence[Any], row: int, field: str) -> Any:
    """A value of a record as a Python number; many times faster than an attribute of a NumPy record."""
    return table[field].item(row) if COMPILED else getattr(table[row], field)  # type: ignore[call-overload]


def set_fields(table: Sequence[Any], row: int, **values: float) -> None:
    """Give fields of a record values."""
    for field, value in values.items():
        if COMPILED:
            table[field][row] = value  # type: ignore[call-overload]
        else:
            setattr(table[row], field, value)


def as_tuple(record: Any) -> tuple[Any, ...]:
    """The values of a record as Python numbers."""
    return record.item() if COMPILED else _values(type(record))(record)  # type: ignore[arg-type]


def columns(table: Sequence[Any], *fields: str) -> NDArray[np.float64]:
    """(rows, fields) the values of some fields of records, a copy."""
    if COMPILED:
        values = np.empty((len(table), len(fields)))
        for column, field in enumerate(fields):
            values[:, column] = table[field]  # type: ignore[call-overload]
        return values
    return np.array([[getattr(row, field) for field in fields] for row in table], dtype=np.float64)


def set_columns(table: Sequence[Any], fields: Sequence[str], values: NDArray[Any]) -> None:
    """Give some fields of records the values, (rows, fields)."""
    if COMPILED:
        for column, field in enumerate(fields):
            table[field] = values[:, column]  # type: ignore[index]
    else:
        for row, numbers in zip(table, values.tolist()):
            for field, number in zip(fields, numbers):
                setattr(row, field, number)


@cache
def _values(kind: type[Any]) -> Callable[[Any], tuple[Any, ...]]:
    names = [field.name for field in fields(kind)]
    if len(names) > 1:
        return attrgetter(*names)
    return lambda record: (getattr(record, names[0]),)


@cache
def _layout(kind: type[Any]) -> np.dtype[Any]:
    sizes = {"float": np.float64, "int": np.int64, "bool": np.bool_}
    layout = np.dtype([(field.name, sizes[str(field.type)]) for field in fields(kind)], align=True)
    return np.dtype((np.record, layout))
