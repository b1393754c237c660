# SPDX-License-Identifier: Apache-2.0
"""Machine code of the kernels."""

from __future__ import annotations

import ctypes
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_type_hints

from billiards_sim.engine.kernels.entries import ENTRIES
from billiards_sim.engine.tables import Packed

C_TYPES: dict[Any, Any] = {float: ctypes.c_double, int: ctypes.c_int64}

_loaded: dict[str, Any] = {}
_functions: dict[str, Callable[..., Any]] = {}


def is_ready() -> bool:
    """Whether there is machine code to call."""
    return bool(_functions)


def compile() -> bool:
    """Wait until machine code is there; returns False where the engine is interpreted."""
    if not _functions and os.environ.get("NUMBA_DISABLE_JIT", "0") != "1":
        here = Path(__file__).parent
        digest = hashlib.sha256()
        for path in sorted([*here.glob("*.py"), *here.glob("kernels/**/*.py")]):
            digest.update(path.read_bytes())
        kept = here / "__pycache__" / f"kernels-{digest.hexdigest()[:16]}.o"
        if not kept.exists():
            try:
                from billiards_sim.engine.compiler import object_code
            except ImportError:
                return False
            kept.parent.mkdir(exist_ok=True)
            beside = kept.with_suffix(f".{os.getpid()}")
            beside.write_bytes(object_code())
            beside.rename(kept)
        _functions.update(_load(kept.read_bytes()))
    return bool(_functions)


def _load(code: bytes) -> dict[str, Callable[..., Any]]:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple().create_target_machine(codemodel="jitdefault", jit=True)
    _loaded["engine"] = engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: _callable(engine.get_function_address(name), entry) for name, entry in ENTRIES.items()}


def _callable(address: int, entry: Callable[..., Any]) -> Callable[..., Any]:
    hints = get_type_hints(entry)
    result = C_TYPES.get(hints.pop("return"))
    given = [C_TYPES.get(kind, ctypes.c_void_p) for kind in hints.values()]
    code = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, *given)(address)

    def call_code(*arguments: Any) -> Any:
        if result is None:
            failed, value = code(None, *arguments), None
        else:
            value = result()
            failed = code(ctypes.byref(value), *arguments)
            value = value.value
        if failed:
            raise RuntimeError(f"the machine code of {entry.__name__} failed")
        return value

    return call_code


def function(entry: Callable[..., Any]) -> Callable[..., Any]:
    """The machine code of an entry that takes numbers alone, or where there is none the entry."""
    return _functions.get(entry.__name__, entry)


def call(entry: Callable[..., Any], *arguments: Any) -> Any:
    """Call an entry of the kernels with blocks of one form, and numbers."""
    if isinstance(arguments[0], Packed):
        code = _functions[entry.__name__]
        return code(*[value.address if isinstance(value, Packed) else value for value in arguments])
    return entry(*arguments)
