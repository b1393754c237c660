# SPDX-License-Identifier: Apache-2.0
"""From kernels to machine code, with Numba, which only this module imports.

An entry becomes a function of addresses and numbers: for each block that it takes, the address of a packed one.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, get_type_hints

import numba
from llvmlite import ir
from numba import extending
from numba.core import types
from numba.core.cgutils import create_struct_proxy
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.extending import intrinsic, register_jitable

from billiards_sim.engine.kernels.entries import ENTRIES
from billiards_sim.engine.kernels.kernel import INLINED, KERNELS
from billiards_sim.engine.tables import record_layout, record_types

OPTIONS = {"_nrt": False}
"""Kernels allocate nothing. Without the counting of references to arrays they run a quarter faster."""

T: Any = types  # typed in part, as what follows
X: Any = extending
fields_of: Any = create_struct_proxy

SCALARS = {float: T.float64, int: T.int64, type(None): T.void}


def dispatchers() -> dict[str, Any]:
    """The entries as functions that Numba has compiled, by name."""
    for function in KERNELS:
        options = {**OPTIONS, "forceinline": function in INLINED}
        register_jitable(no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)(function)
    return {name: _compiled(function) for name, function in ENTRIES.items()}


def object_code() -> bytes:
    """The entries as an object file: for each a C function of its name.

    It takes where to put its result, addresses of packed blocks, and numbers; it returns 0 if all went well. Numba
    cannot call what it compiles in this process any more: kernels become parts, which only the whole makes code of.
    """
    context = cpu_target.target_context
    codegen = context.codegen()
    codegen._library_class = _Whole
    library = codegen.create_library("billiards_sim")
    library.enable_object_caching()
    module = library.create_ir_module("entries")
    codegen._library_class = _Part
    codegen.set_env = lambda name, env: None
    parts: dict[Any, None] = {}
    for name, dispatcher in dispatchers().items():
        (compiled,) = dispatcher.overloads.values()
        _export(context, module, name, compiled)
        _collect(compiled.library, parts)
    for part in parts:
        library.add_linking_library(part)
    with global_compiler_lock:
        library.add_ir_module(module)
        library.finalize()
    code: bytes = library._get_compiled_object()
    return code


class _Part(JITCodeLibrary):
    """What Numba makes of a kernel: optimised by itself, but not linked with what it calls, nor made machine code of.

    That is two thirds of the work, and is all done again with the whole.
    """

    def finalize(self) -> None:
        self._optimize_final_module()  # type: ignore[no-untyped-call]
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0


class _Whole(JITCodeLibrary):
    """All of it, in which only the entries can be called from outside.

    So kernels need not be called as Numba calls them, with two numbers for each table of a state.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.name not in ENTRIES:
                function.linkage = "internal"
        super()._optimize_final_module()  # type: ignore[no-untyped-call]


def _collect(part: Any, parts: dict[Any, None]) -> None:
    # A part and all that it calls.
    if part not in parts:
        parts[part] = None
        for called in part._linking_libraries:
            _collect(called, parts)


def _export(context: Any, module: Any, name: str, compiled: Any) -> None:
    # Numba's own functions have another name, and one more argument for exceptions.
    result, given = compiled.signature.return_type, compiled.signature.args
    kind = context.call_conv.get_function_type(result, given)
    inner = ir.Function(module, kind, compiled.fndesc.llvm_func_name)
    outer = ir.Function(module, ir.FunctionType(kind.return_type, [kind.args[0], *kind.args[2:]]), name)
    builder = ir.IRBuilder(outer.append_basic_block())
    status, value = context.call_conv.call_function(builder, inner, result, given, outer.args[1:])
    if result != T.void:
        builder.store(value, outer.args[0])
    builder.ret(status.code)


class Table(T.Type):  # type: ignore[misc]
    """Rows of a block, one after the other.

    Unlike an array of Numba's it takes no negative index, which kernels have no use for: each look at a row would ask
    whether its index is one.
    """

    def __init__(self, row: Any) -> None:
        self.row = row
        super().__init__(f"Table({row})")


class _TableModel(X.models.StructModel):  # type: ignore[misc]
    def __init__(self, manager: Any, table: Table) -> None:
        super().__init__(manager, table, [("rows", T.CPointer(table.row)), ("count", T.intp)])


def _type_row(_: Any) -> Callable[..., Any]:
    return lambda table, index: table.row if isinstance(table, Table) and isinstance(index, T.Integer) else None


def _type_count(_: Any) -> Callable[..., Any]:
    return lambda table: T.intp if isinstance(table, Table) else None


def _row(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    table = fields_of(signature.args[0])(context, builder, arguments[0])
    return builder.gep(table.rows, [arguments[1]], inbounds=True)


def _count(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return fields_of(signature.args[0])(context, builder, arguments[0]).count


X.register_model(Table)(_TableModel)
X.type_callable(operator.getitem)(_type_row)
X.type_callable(len)(_type_count)
X.lower_builtin(operator.getitem, Table, T.Integer)(_row)
X.lower_builtin(len, Table)(_count)


def _opener(kind: Any) -> Any:
    # What makes a block of its address: tables that look into it, after what its head says of them.
    row_types: list[Any] = [numba.from_dtype(record_layout(record)) for record in record_types(kind).values()]
    table_types = [Table(row) for row in row_types]
    block_type = T.NamedTuple(table_types, kind)

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        address = arguments[0]
        head = builder.inttoptr(address, context.get_value_type(T.CPointer(T.intp)))

        def entry_of_head(index: int) -> Any:
            return builder.load(builder.gep(head, [context.get_constant(T.intp, index)]))

        tables = []
        for index, table_type in enumerate(table_types):
            table = fields_of(table_type)(context, builder)
            table.rows = builder.inttoptr(builder.add(address, entry_of_head(2 * index)), table.rows.type)
            table.count = entry_of_head(2 * index + 1)
            tables.append(table._getvalue())
        return context.make_tuple(builder, block_type, tables)

    @intrinsic
    def opened(_: Any, address: Any) -> Any:
        return block_type(T.intp), build

    return opened


def _compiled(entry: Callable[..., Any]) -> Any:
    hints = get_type_hints(entry)
    result = hints.pop("return")
    openers = {f"open_{name}": _opener(kind) for name, kind in hints.items() if kind not in SCALARS}
    passed = ", ".join(f"open_{name}({name})" if f"open_{name}" in openers else name for name in hints)
    door = eval(f"lambda {', '.join(hints)}: entry({passed})", {"entry": entry, **openers})
    signature = SCALARS[result](*(SCALARS.get(kind, T.intp) for kind in hints.values()))
    njit: Any = numba.njit  # its type stubs do not know every option
    return njit(signature, **OPTIONS)(door)
