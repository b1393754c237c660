# SPDX-License-Identifier: Apache-2.0
"""What a kernel is: a plain function over numbers and tables of records, with the same bits interpreted and compiled.

A table is a list of objects where kernels are interpreted, because Python reads an attribute many times faster than an
array element, and a structured array in machine code. Kernels write `table[row].field` for both. They allocate nothing
and call nothing but each other and `math`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

KERNELS: list[Callable[..., Any]] = []
"""All there are, so that a compiler knows them."""


def kernel(function: Function) -> Function:
    """Mark a function as a kernel."""
    KERNELS.append(function)
    return function
