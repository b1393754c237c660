"""One source, two speeds: kernels that Numba compiles where it is installed and Python interprets where it is not.

A kernel is a plain function over numbers and tables of numbers. A table is a (rows, columns) NumPy array when kernels
are compiled and a list of lists of floats when they are interpreted, because Python reads a list element four times
faster than an array element. Kernels index both as `table[row][column]`; both give the same bits.

Numba's own switch `NUMBA_DISABLE_JIT=1` selects interpretation where Numba is installed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
Rows = Any
"""A table of floats: NDArray (rows, columns) or list of lists."""

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
    return _compiled(function, cache=True) if COMPILED else function


def _compiled(function: Kernel, **options: Any) -> Any:
    njit: Any = numba.njit  # its type stubs do not know every option
    return njit(**options)(function)


def rows(values: ArrayLike) -> Rows:
    """A table with these values, (rows, columns), for kernels to read and write."""
    table = np.array(values, dtype=np.float64, ndmin=2)
    return table if COMPILED else table.tolist()


def copy_rows(table: Rows) -> Rows:
    """A table with the same values that shares nothing with it."""
    return table.copy() if COMPILED else [row.copy() for row in table]


def as_array(table: Rows) -> NDArray[np.float64]:
    """The values of a table as a new array."""
    return np.array(table, dtype=np.float64)


def _drop_stale_cache() -> None:
    # Numba compiles an entry again when its own file changes, not when a kernel that it calls does. Dropping whatever
    # is older than the newest source keeps an edited or updated engine from running old machine code.
    here = Path(__file__).parent
    newest = max(path.stat().st_mtime for path in here.glob("*.py"))
    for cached in here.glob("__pycache__/*.nb[ic]"):
        try:
            if cached.stat().st_mtime < newest:
                cached.unlink()
        except OSError:
            pass  # another process was faster, or the directory is read-only


if COMPILED:
    _drop_stale_cache()
