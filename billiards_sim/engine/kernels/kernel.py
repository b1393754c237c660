# SPDX-License-Identifier: Apache-2.0
"""What a kernel is: a plain function over numbers and tables of records, with the same bits interpreted and compiled.

A table is a list of objects where kernels are interpreted, because Python reads an attribute many times faster than an
array element, and a structured array in machine code. Kernels write `table[row].field` for both, with no negative row.
They allocate nothing and call nothing but each other and `math`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

KERNELS: list[Callable[..., Any]] = []
"""All there are, so that a compiler knows them."""

INLINED: set[Callable[..., Any]] = set()
"""Those of them that machine code has in place of each call."""


def kernel(function: Function) -> Function:
    """Mark a function as a kernel."""
    KERNELS.append(function)
    return function


def inlined(function: Function) -> Function:
    """Mark a function as a kernel that machine code has in place of each call.

    For what every event calls, from one place: a call hands over some twenty addresses and numbers. Where there are
    many calls the code grows, and compiling takes far longer.
    """
    INLINED.add(function)
    return kernel(function)
