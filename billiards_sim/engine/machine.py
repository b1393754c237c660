# SPDX-License-Identifier: Apache-2.0
"""Machine code of the kernels: nobody waits for it, and all use it as soon as it is there.

The first simulation that plays starts a search on a thread, and goes on interpreted: what is kept is loaded at once;
where nothing is, another process compiles it meanwhile. On a thread, because Python hears signals on the main one: an
exception of a user's handler cannot come amidst, and be taken for a failure here.
"""

from __future__ import annotations

import _thread
import atexit
import ctypes
import importlib.util
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, get_type_hints

from billiards_sim.engine import object_file
from billiards_sim.engine.kernels.entries import ENTRIES
from billiards_sim.engine.tables import Packed

SWITCH = "BILLIARDS_SIM_COMPILE"
"""Environment variable: 0 has the kernels interpreted."""

LOOK = 0.5
"""s that the first to play waits at most while a kept file is looked for and loaded, which takes 0.1 s. A thread beside
one that interprets kernels would take ten times longer: it gets the interpreter's lock every 5 ms."""

PATIENCE = 1.0
"""s that `compile` waits before it says what for."""

COMPILING = "compiling the engine, about 20 s"
KEPT = f"{COMPILING}; it is kept for the next time"
NOT_KEPT = f"{COMPILING}; it cannot be kept, no cache directory can be written: NUMBA_CACHE_DIR may name one"

C_TYPES: dict[Any, Any] = {float: ctypes.c_double, int: ctypes.c_int64}

_functions: dict[str, Callable[..., Any]] = {}

_busy = threading.Lock()
"""Held for the milliseconds that neither a fork nor the end of the process may cut short."""


class Search:
    """Brings machine code, on a thread.

    Attributes:
        looked: set when code that was kept is loaded, or there is none.
        ended: set when there is nothing more to wait for.
        maker: the other process, if there was none.
        possible: whether there is Numba to make it with.
        failure: why nothing came.
    """

    def __init__(self) -> None:
        self.looked = threading.Event()
        self.ended = threading.Event()
        self.maker: object_file.Maker | None = None
        self.possible = True
        self.failure = ""

    def bring(self) -> None:
        """Do it; once."""
        try:
            self._look()
            self.looked.set()
            if self.maker is not None:
                code = self.maker.code()
                with _busy:
                    _load(code)
        except Exception as error:
            self.failure = f"{type(error).__name__}: {error}"
        finally:
            self.looked.set()
            self.ended.set()

    def _look(self) -> None:
        # Imports take an exception of a handler that is an OSError, as TimeoutError is, for a file that is not there.
        self.possible = importlib.util.find_spec("numba") is not None
        if not self.possible:
            return
        with _busy:
            name = object_file.file_name()
            code, folder = object_file.find(name)
            if code is not None:
                _load(code)
                return
            if folder is None:
                _say(NOT_KEPT)
            self.maker = object_file.Maker(name, folder)


_search: Search | None = None
_sought = False
_ended = False


def is_ready() -> bool:
    """Whether there is machine code to call."""
    return bool(_functions)


def seek() -> None:
    """Let machine code come, without waiting until it is compiled. Only the first call does something.

    Raises:
        ValueError: the environment variable `BILLIARDS_SIM_COMPILE` is neither 0 nor 1.
    """
    global _search, _sought
    if _sought:
        return
    wanted = _is_wanted()
    with _busy:
        if wanted and _search is None:
            search = Search()
            with suppress(RuntimeError):  # the process ends, and has no more threads
                _begin(search.bring)
                _search = search
        _sought = True
    if _search is not None:
        _search.looked.wait(LOOK)


def compile() -> bool:
    """Wait until machine code is there; returns False where the engine is interpreted.

    Raises:
        ValueError: the environment variable `BILLIARDS_SIM_COMPILE` is neither 0 nor 1.
    """
    seek()
    if _search is not None:
        if not _search.ended.wait(PATIENCE) and (_search.maker is None or _search.maker.keeps):
            _say(KEPT)
        _search.ended.wait()
        if not _functions and _search.possible:
            _go_own_way(_search)
    return is_ready()


def _is_wanted() -> bool:
    switch = os.environ.get(SWITCH, "")
    if switch not in ("", "0", "1"):
        raise ValueError(f"{SWITCH} must be 0 (interpreted) or 1 (compiled), got {switch!r}")
    disabled = os.environ.get("NUMBA_DISABLE_JIT", "") not in ("", "0")
    return switch != "0" and not disabled


def _go_own_way(search: Search) -> None:
    # Where object code cannot be had: as Numba does it, in this process. On a thread, as the search.
    ended = threading.Event()

    def compile_here() -> None:
        try:
            from billiards_sim.engine.compiler import dispatchers

            _functions.update(dispatchers())
        except Exception as error:
            _say(f"the engine stays interpreted: {type(error).__name__}: {error}")
        finally:
            ended.set()

    _say(f"compiling the engine in this process, since another one did not: {search.failure}")
    _begin(compile_here)
    ended.wait()


def _begin(work: Callable[[], None]) -> None:
    # An exception that a handler of signals raises amidst `threading.Thread.start` breaks the thread that is started,
    # one amidst `join` has older Pythons take it for ended.
    _thread.start_new_thread(work, ())


def _say(what: str) -> None:
    print(f"billiards_sim: {what}", file=sys.stderr)


def _load(code: bytes) -> None:
    if _ended:
        return
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple().create_target_machine(codemodel="jitdefault", jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _functions.update({name: _callable(engine.get_function_address(name), entry) for name, entry in ENTRIES.items()})
    engine.detach()  # it lives as long as the process, at whose end nothing is in order for LLVM to be cleared away


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


def _begin_anew() -> None:
    # In a process that was forked: the search goes on in the other one alone.
    global _search, _sought
    if _search is not None and _search.maker is not None:
        _search.maker.disown()
    _search, _sought = None, False
    _busy.release()


def _end() -> None:
    # LLVM must not be at work when the process takes itself apart.
    global _sought, _ended
    with _busy:
        _sought = _ended = True


atexit.register(_end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_busy.acquire, after_in_parent=_busy.release, after_in_child=_begin_anew)
