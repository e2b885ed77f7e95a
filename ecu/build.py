"""`python -m ecu.build [--all]`: make the library of kernels that Python calls (`ecu/library.py`).

For this processor, with `--all` for every one of its architecture. What Python calls is called once, with
kernels as plain Python, to see which they are and with what; numba translates those and all that they call,
LLVM optimises them as one program, and a C compiler links it. numba and LLVM are needed here alone.
`numba.pycc`, which did the like, is deprecated without a successor; this uses numba's compiler up to LLVM's
text, and llvmlite.
"""

import argparse
import importlib
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple, NoReturn

import numba
from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba.core import codegen, cpu
from numba.core.registry import cpu_target

from ecu import jit
from ecu.errors import UserError
from ecu.interpreted import interpreted
from ecu.library import BASELINE, FOLDER, MANIFEST, V3, Spec, file_name, has_v3, spec_of

OPTIONS: Final = {
    "error_model": "numpy",
    "fastmath": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}

MACHINERY: Final = {"ecu.errors", "ecu.interpreted", "ecu.jit", "ecu.library"}
"""Modules whose texts are in no kernel: they call them."""

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


types: Any = numba.core.types  # whose names numba's own annotations hide in part


class Call(NamedTuple):
    """A kernel that Python called, and with what."""

    kernel: "Seen"
    types: tuple[Any, ...]
    specs: tuple[Spec, ...]


class Seen:
    """A kernel as plain Python, which notes how Python calls it."""

    calls: Final = dict[tuple[Any, ...], Call]()
    modules: Final = set[str]()
    _depth = 0

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        module = jit.module_of(function)
        Seen.modules.add(module)
        self.name = f"{module}.{function.__qualname__}"
        self._plain = interpreted(function)
        self.dispatcher = numba.njit(**OPTIONS)(function)

    def __call__(self, *arguments: Any) -> Any:
        if Seen._depth == 0:
            self._note(arguments)
        Seen._depth += 1
        try:
            return self._plain(*arguments)
        finally:
            Seen._depth -= 1

    def _note(self, arguments: tuple[Any, ...]) -> None:
        specs = tuple(spec for argument in arguments if (spec := spec_of(argument)) is not None)
        if len(specs) == len(arguments):
            found = tuple(numba.typeof(argument) for argument in arguments)
            Seen.calls.setdefault((self.name, specs), Call(self, found, specs))

    @property
    def _numba_type_(self) -> Any:
        return types.Dispatcher(self.dispatcher)


class _Part(codegen.JITCodeLibrary):  # type: ignore[misc]
    """The code of one function, which is neither linked nor run before all is there."""

    def finalize(self) -> None:
        self._finalized = True


def watch() -> None:
    """Note from now on how kernels of modules that are loaded later are called; they are plain Python."""
    os.environ["NUMBA_DISABLE_JIT"] = "0"
    noted: Any = lambda function, parallel=False: interpreted(function) if parallel else Seen(function)  # noqa: E731
    jit.kernel = noted


def _signature(call: Call) -> tuple[Any, ...]:
    """Return the types of all parameters: those not given have their default."""
    return tuple(call.kernel.dispatcher._compiler.fold_argument_types(call.types, {})[1])


def translate(calls: Iterable[Call]) -> list[Any]:
    """Return numba's result for each call, not yet optimised."""
    codegen.JITCPUCodegen._library_class = _Part
    cpu.CPUContext.get_executable = lambda self, library, fndesc, env: [].append  # a key of its own for each
    results = []
    for call in calls:
        signature = _signature(call)
        call.kernel.dispatcher.compile(signature)
        results.append(call.kernel.dispatcher.overloads[signature])
    return results


def _parts(results: Iterable[Any]) -> list[Any]:
    """Return the code of all functions that results call, directly or not."""
    found, ahead = dict[int, Any](), [result.library for result in results]
    while ahead:
        part = ahead.pop()
        if id(part) not in found:  # names are not unique
            found[id(part)] = part
            ahead += part._linking_libraries
    return list(found.values())


def _returned(kind: Any) -> Spec | None:
    if isinstance(kind, types.NoneType):
        return ("none",)
    if isinstance(kind, types.Boolean):
        return ("bool",)
    if isinstance(kind, types.Integer | types.Float):
        return ("number", numba.np.numpy_support.as_dtype(kind).str)
    if isinstance(kind, types.BaseTuple):
        made = getattr(kind, "instance_class", tuple)
        inside = [_returned(part) for part in kind.types]
        name = f"{made.__module__}:{made.__qualname__}"
        return None if None in inside else ("tuple", name, *inside)
    return None


def _entry(module: Any, symbol: str, result: Any) -> None:
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
    for wanted in kind.args[2:]:
        value = builder.load(place())
        if isinstance(wanted, ir.PointerType):
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


def link(results: list[Any], symbols: list[str]) -> Any:
    """Return LLVM's module of all results with an entry for each, nothing else visible."""
    entries = ir.Module("entries")
    entries.triple = binding.get_process_triple()
    for symbol, result in zip(symbols, results, strict=True):
        _entry(entries, symbol, result)
    whole = binding.parse_assembly(str(entries))
    for part in _parts(results):
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


def _link_shared(code: bytes, file: Path) -> None:
    with tempfile.TemporaryDirectory(prefix="brake-ecu-") as folder:
        made, runtime, shared = (Path(folder, name) for name in ("kernels.o", "runtime.c", "kernels.so"))
        made.write_bytes(code)
        runtime.write_text(RUNTIME)
        options = ["-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-s", "-Wl,--no-undefined", "-lm"]
        command = [compiler() or "cc", str(made), str(runtime), *options, "-o", str(shared)]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            words = (getattr(error, "stderr", "") or str(error)).splitlines()[-1][:300]
            raise UserError(command[0], "", f"{words}; install a C compiler, or set CC to one") from None
        file.write_bytes(shared.read_bytes())


def processors(all_of_them: bool) -> list[str]:
    """Return those that a library is made for."""
    least = BASELINE[platform.machine()]
    if platform.machine() != "x86_64":
        return [least]
    return [least, V3] if all_of_them else [V3 if has_v3() else least]


def compiler() -> str | None:
    """Return the C compiler that links a library, None without one."""
    return shutil.which(os.environ.get("CC", "cc"))


def is_up_to_date(package: str, wanted: list[str]) -> bool:
    """Return whether the library of a package is made for `wanted`, and from the texts that are there."""
    found = jit.library(package)
    return (
        found is not None
        and set(wanted) <= set(found.manifest["processors"])
        and all(found.fits(module, jit.text_digest) for module in found.manifest["modules"])
    )


def build(package: str, load_workload: Callable[[], Callable[[], None]], wanted: list[str]) -> None:
    """Make the library of a package for processors `wanted` from what a workload calls.

    `load_workload` imports it: afterwards kernels are plain Python.

    Raises:
        UserError: the C compiler cannot link it.
    """
    began = time.monotonic()
    watch()
    for module in sorted(jit.modules_with_kernels(package)):
        with suppress(ImportError):  # of a bench: its peers are not installed
            importlib.import_module(module)
    load_workload()()
    calls = [call for call in Seen.calls.values() if call.kernel.name.startswith(f"{package}.")]
    print(f"{package}: translating {len(calls)} kernels and all that they call, about a minute", flush=True)
    results = translate(calls)
    kept = [
        (call, result, returned)
        for call, result in zip(calls, results, strict=True)
        if (returned := _returned(result.fndesc.restype)) is not None
    ]
    symbols = [f"kernel_{number}" for number in range(len(kept))]
    whole = link([result for _, result, _ in kept], symbols)
    print(f"{package}: translated after {time.monotonic() - began:.0f} s; optimising", flush=True)
    kernels = dict[str, list[dict[str, Any]]]()
    for symbol, (call, _, returned) in zip(symbols, kept, strict=True):
        row = {"symbol": symbol, "arguments": call.specs, "returns": returned}
        kernels.setdefault(call.kernel.name, []).append(row)
    root = Path(importlib.import_module(package).__file__ or "").parent
    folder = root / FOLDER
    folder.mkdir(exist_ok=True)
    (folder / MANIFEST).unlink(missing_ok=True)
    for processor in wanted:
        _link_shared(machine_code(whole, processor), folder / file_name(processor))
    _write_manifest(package, folder, kernels, wanted)
    print(f"{folder}: {', '.join(wanted)}, after {time.monotonic() - began:.0f} s", flush=True)


def _write_manifest(
    package: str, folder: Path, kernels: dict[str, list[dict[str, Any]]], wanted: list[str]
) -> None:
    needs = {
        module: [name for name in jit.sources_of_kernels(module) if name not in MACHINERY]
        for module in sorted(Seen.modules)
        if module.partition(".")[0] == package
    }
    sources = {name: jit.text_digest(name) for name in sorted(set().union(*needs.values()))}
    manifest = {
        "numba": numba.__version__,
        "processors": wanted,
        "sources": sources,
        "modules": needs,
        "kernels": kernels,
    }
    text = json.dumps(manifest, separators=(",", ":"))
    (folder / MANIFEST).write_text(text, "utf-8")


def make(package: str, load_workload: Callable[[], Callable[[], None]], everything: bool) -> int:
    """Make the library of a package unless it is up to date; return an exit code.

    The process is to end by `leave`.
    """
    wanted = processors(everything)
    if not is_up_to_date(package, wanted):
        try:
            build(package, load_workload, wanted)
        except UserError as error:
            print(error, file=sys.stderr)
            return 1
    return 0


def leave(code: int) -> NoReturn:
    """End the process without taking apart what numba believes that it has compiled."""
    sys.stdout.flush()
    os._exit(code)


def _load_workload() -> Callable[[], None]:
    from ecu.entries import call_every_entry

    return call_every_entry


def main() -> NoReturn:
    parser = argparse.ArgumentParser(
        prog="python -m ecu.build", description="Compile the kernels of the ECU."
    )
    parser.add_argument("--all", action="store_true", help="for every processor of this architecture")
    leave(make("ecu", _load_workload, parser.parse_args().all))


if __name__ == "__main__":
    main()
