"""Machine code of kernels that Python calls: by numba up to LLVM's text, llvmlite and a C compiler."""

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numba
from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba.core import codegen, cpu
from numba.core.registry import cpu_target
from numba.np.numpy_support import as_dtype

from ecu.building.c_compiler import compile_shared
from ecu.building.calls import Call, Seen
from ecu.library import Spec, layout, places_of

RUNTIME: Final = r"""
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/* What numba's compiled code asks of its runtime: memory of arrays that a kernel makes. */
typedef struct {
    size_t references;
    void (*destroy)(void *, size_t, void *);
    void *of_destroy, *data;
    size_t size;
    void *allocator;
} memory;

void *NRT_MemInfo_alloc_aligned(size_t size, uint32_t align) {
    memory *made = calloc(1, sizeof *made + size + align);
    if (!made) return NULL;
    uintptr_t begin = (uintptr_t)(made + 1);
    made->references = 1;
    made->size = size;
    made->data = (void *)(align ? (begin + align - 1) / align * align : begin);
    return made;
}

void *NRT_MemInfo_alloc(size_t size) { return NRT_MemInfo_alloc_aligned(size, 0); }

void NRT_MemInfo_call_dtor(memory *made) {
    if (made->destroy) made->destroy(made->data, made->size, made->of_destroy);
    free(made);
}

void *NRT_Allocate(size_t size) { return malloc(size); }
void NRT_Free(void *made) { free(made); }

/* Named where an exception would be unpacked, which nobody does: an entry returns a status. */
void *PyExc_RuntimeError;
void PyErr_SetString(void *kind, const char *text) { (void)kind, (void)text; }
"""


COUNTED: Final = {"NRT_incref": 1, "NRT_decref": -1}
"""What numba's code calls to count references to the owner of an array."""

types: Any = numba.core.types  # whose names numba's own annotations hide in part


class Row(NamedTuple):
    """A kernel, the arguments that it is compiled for, and numba's result."""

    name: str
    arguments: tuple[Spec, ...]
    result: Any


class _Part(codegen.JITCodeLibrary):  # type: ignore[misc]
    """The code of one function, which is neither linked nor run before all is there."""

    def finalize(self) -> None:
        self._finalized = True


def _signature(call: Call) -> tuple[Any, ...]:
    """Return the types of all parameters: those not given have their default."""
    return tuple(call.kernel.dispatcher._compiler.fold_argument_types(call.types, {})[1])


def translate(calls: Iterable[Call]) -> list[Row]:
    """Return what numba makes of each call, not yet optimised."""
    codegen.JITCPUCodegen._library_class = _Part
    cpu.CPUContext.get_executable = lambda self, library, fndesc, env: [].append  # a key of its own for each
    rows = []
    for call in calls:
        signature = _signature(call)
        call.kernel.dispatcher.compile(signature)
        rows.append(Row(call.kernel.name, call.specs, call.kernel.dispatcher.overloads[signature]))
    return rows


def _parts(results: Iterable[Any]) -> list[Any]:
    """Return the code of all functions that results call, directly or not."""
    found, ahead = dict[int, Any](), [result.library for result in results]
    while ahead:
        part = ahead.pop()
        if id(part) not in found:  # names are not unique
            found[id(part)] = part
            ahead += part._linking_libraries
    return list(found.values())


def returned_spec(kind: Any) -> Spec | None:
    """Return how a manifest writes what a kernel returns, None for what no library can give."""
    if isinstance(kind, types.NoneType):
        return ("none",)
    if isinstance(kind, types.Boolean):
        return ("bool",)
    if isinstance(kind, types.Integer | types.Float):
        return ("number", as_dtype(kind).str)
    if isinstance(kind, types.BaseTuple):
        inside = [returned_spec(part) for part in kind.types]
        return None if None in inside else ("tuple", _made_by(kind), *inside)
    return None


def _made_by(kind: Any) -> str:
    made = getattr(kind, "instance_class", tuple)
    return f"{made.__module__}:{made.__qualname__}"


def taken_spec(kind: Any) -> Spec | None:
    """Return the kind of an argument by numba's type, as `ecu.library.spec_of` has it of a value."""
    if isinstance(kind, types.Array):
        return ("array", layout(as_dtype(kind.dtype)), kind.ndim, kind.layout, kind.mutable)
    if isinstance(kind, types.Record):
        return ("record", layout(as_dtype(kind)))
    if isinstance(kind, types.NumPyRandomGeneratorType):
        return ("generator",)
    if isinstance(kind, types.BaseTuple):
        inside = [taken_spec(part) for part in kind.types]
        return None if None in inside else ("tuple", _made_by(kind), *inside)
    return returned_spec(kind)


def within(package: str) -> Iterator[Row]:
    """Yield the kernels of a package that kernels call, as `translate` has compiled them for that.

    One that is compiled for a constant is compiled for any number in its place.
    """
    for kernel in (one for one in Seen.every if one.name.startswith(f"{package}.")):
        found = kernel.dispatcher.overloads
        for signature in {tuple(map(types.unliteral, given)): None for given in found}:
            kernel.dispatcher.compile(signature)
            given = [kind for kind in signature if not isinstance(kind, types.Omitted)]
            specs = tuple(spec for kind in given if (spec := taken_spec(kind)) is not None)
            if len(specs) == len(given):
                yield Row(kernel.name, specs, found[signature])


def _empty_places(spec: Spec) -> list[bool]:
    """Return which places of an argument hold nothing: those where numba keeps the owner of an array."""
    if spec[0] == "tuple":
        return [empty for part in spec[2:] for empty in _empty_places(part)]
    empty = [False] * places_of(spec)
    if spec[0] == "array":
        empty[:2] = True, True
    return empty


def _count_references(module: Any) -> None:
    """Add how references to an array's owner are counted.

    In place of numba's functions, which are not inlined: an argument has no owner, and once that is seen
    nothing remains of them. Not atomic: what a kernel makes, no other thread knows.
    """
    count = ir.IntType(64)
    kind = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer()])
    destroy = ir.Function(module, kind, "NRT_MemInfo_call_dtor")
    for name, change in COUNTED.items():
        function = ir.Function(module, kind, name)
        function.attributes.add("alwaysinline")
        builder = ir.IRBuilder(function.append_basic_block())
        owner = function.args[0]
        with builder.if_then(builder.icmp_unsigned("!=", owner, ir.Constant(owner.type, None))):
            place = builder.bitcast(owner, count.as_pointer())
            left = builder.add(builder.load(place), count(change))
            builder.store(left, place)
            if change < 0:
                with builder.if_then(builder.icmp_unsigned("==", left, count(0))):
                    builder.call(destroy, [owner])
        builder.ret_void()


def _entry(module: Any, symbol: str, result: Any, specs: Sequence[Spec]) -> None:
    """Add a function that takes a block of places, see `ecu/library.py`, and calls the kernel."""
    context, described = cpu_target.target_context, result.fndesc
    whole, block = ir.IntType(64), ir.IntType(64).as_pointer()
    kind = context.call_conv.get_function_type(described.restype, described.argtypes)
    kernel = ir.Function(module, kind, described.llvm_func_name)
    entry = ir.Function(module, ir.FunctionType(ir.IntType(32), [block]), symbol)
    builder = ir.IRBuilder(entry.append_basic_block())
    returned, excepted = (builder.alloca(given.pointee) for given in kind.args[:2])
    at = 0

    def place() -> Any:
        nonlocal at
        at += 1
        return builder.gep(entry.args[0], [ir.IntType(32)(at - 1)])

    arguments = []
    empty = [one for spec in specs for one in _empty_places(spec)]
    for wanted, nothing in zip(kind.args[2:], empty, strict=True):
        value = builder.load(place())
        if nothing:
            value = ir.Constant(wanted, None)
        elif isinstance(wanted, ir.PointerType):
            value = builder.inttoptr(value, wanted)
        elif isinstance(wanted, ir.IntType):
            value = value if wanted.width == 64 else builder.trunc(value, wanted)
        else:
            value = builder.bitcast(value, ir.DoubleType())
            value = builder.fptrunc(value, wanted) if isinstance(wanted, ir.FloatType) else value
        arguments.append(value)
    status = builder.call(kernel, [returned, excepted, *arguments])

    def keep(value: Any, of: Any) -> None:
        if isinstance(of, types.BaseTuple):
            for index, inside in enumerate(of.types):
                keep(builder.extract_value(value, index), inside)
        elif not isinstance(of, types.NoneType):
            if isinstance(value.type, ir.IntType) and value.type.width < 64:
                signed = isinstance(of, types.Integer) and of.signed
                value = (builder.sext if signed else builder.zext)(value, whole)
            elif isinstance(value.type, ir.FloatType):
                value = builder.fpext(value, ir.DoubleType())
            builder.store(value, builder.bitcast(place(), value.type.as_pointer()))

    keep(builder.load(returned), described.restype)
    builder.ret(status)


def link(rows: Sequence[Row], symbols: Sequence[str]) -> Any:
    """Return LLVM's module of all kernels with an entry for each, nothing else visible."""
    entries = ir.Module("entries")
    entries.triple = binding.get_process_triple()
    _count_references(entries)
    for symbol, row in zip(symbols, rows, strict=True):
        _entry(entries, symbol, row.result, row.arguments)
    whole = binding.parse_assembly(str(entries))
    for part in _parts(row.result for row in rows):
        for function in part._final_module.functions:
            if function.name in COUNTED and not function.is_declaration:
                function.linkage = binding.Linkage.linkonce_any  # numba's own are replaced
        whole.link_in(part._final_module, preserve=True)
    for function in whole.functions:
        if not function.is_declaration and function.name not in symbols:
            function.linkage = binding.Linkage.internal
    for variable in whole.global_variables:
        if not variable.is_declaration:
            variable.linkage = binding.Linkage.internal
    whole.verify()
    return whole


def machine_code(whole: Any, processor: str) -> bytes:
    """Return the object file of a module, optimised for a processor; the module stays as it was."""
    triple = binding.get_process_triple()
    machine = binding.Target.from_triple(triple).create_target_machine(
        cpu=processor, opt=3, reloc="pic", codemodel="default"
    )
    module = binding.parse_bitcode(whole.as_bitcode())
    module.data_layout, module.triple = str(machine.target_data), triple
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization, options.slp_vectorization = True, True
    for _ in range(2):  # what is inlined late is optimised once more
        passes = binding.create_pass_builder(machine, options)
        passes.getModulePassManager().run(module, passes)
    return bytes(machine.emit_object(module))


def link_shared(code: bytes, file: Path) -> None:
    """Write an object file as a shared library. Raises UserError: the C compiler cannot."""
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder:
        made, runtime, shared = (Path(folder, name) for name in ("kernels.o", "runtime.c", "kernels.so"))
        made.write_bytes(code)
        runtime.write_text(RUNTIME)
        compile_shared((made, runtime), ("-lm",), shared)
        part = file.with_suffix(".part")
        part.write_bytes(shared.read_bytes())
        part.replace(file)
