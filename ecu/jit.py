"""Kernels: from the compiled library of their package where it fits (`ecu/library.py`), from numba otherwise.

numba's disk cache checks a function's own file only: after an edit of a callee or of a constant elsewhere it
would silently run the old code. The kernels of a module are therefore cached in a folder named after the
texts of the module and of all that it imports, directly or not, of its own package and of `ecu`, whose
kernels the laboratory calls. A module imported by a name in a string does not count, nor does a file that is
read.

`NUMBA_CACHE_DIR` chooses the place, default `~/.cache/brake-ecu`; it may be read-only where nothing has to be
compiled. What lies there is run (numba's cache is pickle and machine code), so a place in which anybody else
may put or exchange files is refused. With `NUMBA_DISABLE_JIT=1` kernels run as plain Python.
"""

import errno
import hashlib
import os
import re
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, TypeVar, cast

from ecu.errors import UserError
from ecu.interpreted import interpreted
from ecu.library import FOLDER, Entry, Library, open_library

Function = TypeVar("Function", bound=Callable[..., Any])

# A numba record or a row of a structured array: attributes by field name, typed by its dtype only.
Record = Any

# Kernels raise nothing and follow IEEE 754: x/0 is inf or NaN and is caught by the module's own checks.
OPTIONS = {"cache": True, "error_model": "numpy", "fastmath": False}

CACHE_ROOT = Path(
    os.environ.get("NUMBA_CACHE_DIR")
    or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "brake-ecu"
)
_UNWRITABLE = {errno.EACCES, errno.EPERM, errno.EROFS}
_REMEDY = "set NUMBA_CACHE_DIR to a folder of yours"

_COMMENT = re.compile(rb"#[^\n]*|\\\n")
_FROM = re.compile(rb"(?m)(?:^|[;:])[ \t]*from\b[ \t]*([.\w]+)[ \t]+import\b[ \t]*(\([^)]*\)|[^\n;]*)")
_KERNEL = re.compile(rb"^@(?:parallel_|batch_)?kernel\b", re.MULTILINE)
_IMPORT = re.compile(rb"(?:^|[;:])[ \t]*import\b([^\n;]*)", re.MULTILINE)


class _Source(NamedTuple):
    digest: bytes
    imports: frozenset[str]  # modules that it may import, and names in them


@cache
def _modules(package: str) -> dict[str, Path]:
    """Return the files of a package, or of a single module, by the names of the modules."""
    spec = find_spec(package)
    found = {package: Path(spec.origin)} if spec and spec.has_location and spec.origin else {}
    for root in (spec.submodule_search_locations or []) if spec else []:
        for path in Path(root).rglob("*.py"):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join((package, *parts)).removesuffix(".__init__")] = path
    return found


@cache
def _source(module: str, path: Path) -> _Source:
    text = path.read_bytes()
    package = module if path.stem == "__init__" else module.rpartition(".")[0]
    return _Source(hashlib.sha256(text).digest(), frozenset(_imports(package, _COMMENT.sub(b"", text))))


def _imports(package: str, text: bytes) -> Iterator[str]:
    """Yield every module that a module of `package` may import: a text that looks like an import counts."""
    for start, names in _FROM.findall(text):
        source = start.decode()
        if dots := len(source) - len(source.lstrip(".")):
            above = package.split(".")[: 1 - dots or None]
            source = ".".join([*above, *filter(None, [source[dots:]])])
        yield source
        yield from (f"{source}.{name.decode()}" for name in re.findall(rb"\w+", names))
    for names in _IMPORT.findall(text):
        for name in re.findall(rb"[\w.]+", names):
            parts = name.decode().split(".")
            yield from (".".join(parts[:count]) for count in range(1, len(parts) + 1))


def sources_of_kernels(module: str) -> dict[str, bytes]:
    """Return digests of the texts that the kernels of a module may depend on, by module.

    They are the module and what it imports, directly or not, of its own package, `ecu` and the laboratory.
    """
    packages = ("ecu",) if module.startswith("ecu.") else ("ecu", "brakelab", module.partition(".")[0])
    known = {name: path for package in packages for name, path in _modules(package).items()}
    ahead, found = [module], dict[str, bytes]()
    while ahead:
        name = ahead.pop()
        if name in known and name not in found:
            source = _source(name, known[name])
            found[name] = source.digest
            ahead += source.imports
    return dict(sorted(found.items()))


def modules_with_kernels(package: str) -> list[str]:
    """Return the modules of a package that have kernels."""
    found = _modules(package).items()
    return [name for name, path in found if _KERNEL.search(path.read_bytes())]


@cache
def _folder(module: str) -> str:
    """Return the folder of a module's compiled kernels, made if that is possible."""
    digest = hashlib.sha256(compiler().__version__.encode())
    for name, text in sources_of_kernels(module).items():
        digest.update(name.encode() + b"\0" + text)
    folder = CACHE_ROOT / f"{module}-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        if error.errno not in _UNWRITABLE:
            raise UserError(str(folder), "", f"cannot be made ({error.strerror}); {_REMEDY}") from None
    try:
        os.scandir(folder).close()
    except FileNotFoundError:
        pass  # whoever compiles a kernel hears of it
    except OSError as error:
        raise UserError(str(folder), "", f"cannot be read ({error.strerror}); {_REMEDY}") from None
    folder = folder.resolve()
    if found := open_to_others(folder):
        remedy = "chmod go-w it, or set NUMBA_CACHE_DIR to a folder of yours alone"
        raise UserError(str(found), "", f"others may put compiled kernels here, which are run; {remedy}")
    return str(folder)


def open_to_others(folder: Path) -> Path | None:
    """Return which of `folder` and those above it lets others put or exchange files, None: none does.

    Root, and whoever owns `/`, is trusted. In a sticky folder (`/tmp`) only owners exchange files. `folder`
    contains no links.
    """
    if not hasattr(os, "geteuid"):  # a system whose folders have no such owners
        return None
    trusted = {os.geteuid(), 0, os.stat("/").st_uid}  # `/` in a user namespace: nobody's
    for path in filter(Path.exists, (folder, *folder.parents)):
        found = path.stat()
        writers = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if writers == stat.S_IWGRP and _of_one_user(found.st_gid):
            writers = 0
        if path != folder and found.st_mode & stat.S_ISVTX:
            writers = 0
        if writers or found.st_uid not in trusted:
            return path
    return None


def _of_one_user(group: int) -> bool:
    """Return whether a group is the user's own: many systems give each one, and let it write by default."""
    try:
        import grp
        import pwd

        found, user = grp.getgrgid(group), pwd.getpwuid(os.geteuid()).pw_name
    except (ImportError, KeyError):
        return False
    return found.gr_name == user and set(found.gr_mem) <= {user}


_BEGINS: list[Callable[[Any], None]] = []
"""Called with the dispatcher before anything is compiled."""


@cache
def compiler() -> ModuleType:
    """Return numba, which is loaded where something has to be compiled, and reports what it compiles."""
    try:
        import numba
        import numba.core.event as event
        from numba.core import caching

        from ecu.unboxing import take_records_by_address
    except ImportError:
        remedy = f"{sys.executable} -m pip install numba"
        raise UserError("numba", "", f"is not installed, and has to compile a kernel: {remedy}") from None

    class Begins(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            for begins in tuple(_BEGINS):
                begins(event.data["dispatcher"])

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Begins())
    caching._CacheLocator.ensure_cache_path = _make_folder
    take_records_by_address()
    return numba


def _make_folder(locator: Any) -> None:
    with suppress(OSError):  # numba would ask for a folder that can be written, or take one that can go stale
        os.makedirs(locator.get_cache_path(), exist_ok=True)


def _refuse_unwritable(dispatcher: Any) -> None:
    """Say before a kernel is compiled, not minutes later, that it cannot be kept."""
    folder = dispatcher.stats.cache_path
    if folder is not None and not os.access(folder, os.W_OK):
        name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
        raise UserError(str(CACHE_ROOT), "", f"lacks {name} and cannot be written; {_REMEDY}")


_BEGINS.append(_refuse_unwritable)


def before_compiling(begins: Callable[[Any], None]) -> None:
    """Have `begins` called with numba's dispatcher before anything is compiled."""
    if "numba" in sys.modules:
        compiler()
    _BEGINS.append(begins)


def stop_listening(begins: Callable[[Any], None]) -> None:
    """Call `begins` of `before_compiling` no more."""
    _BEGINS.remove(begins)


def interprets() -> bool:
    """Return whether kernels run as plain Python."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


@cache
def text_digest(module: str) -> str | None:
    """Return what stands for the text of a module, None without one."""
    path = _modules(module.partition(".")[0]).get(module)
    return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def library(package: str) -> Library | None:
    """Return the compiled library of a package, None: none is for this processor or BRAKE_ECU_LIBRARY=0."""
    if os.environ.get("BRAKE_ECU_LIBRARY") == "0":
        return None
    spec = find_spec(package)
    roots = (spec.submodule_search_locations or []) if spec else []
    return next(filter(None, (open_library(Path(root) / FOLDER) for root in roots)), None)


@cache
def library_of(module: str) -> Library | None:
    """Return the library in which the kernels of a module stand as they are now."""
    found = library(module.partition(".")[0])
    return found if found is not None and found.fits(module, text_digest) else None


def compiler_version() -> str:
    """Return the version of numba that made the kernels."""
    found = library("ecu")
    return compiler().__version__ if found is None else str(found.manifest["numba"])


def kernel(function: Function, parallel: bool = False, nogil: bool = False) -> Function:
    """Compile `function` with numba (no Python objects, no fastmath), unless a library has it.

    What numba compiles is cached on disk. `nogil`: other threads run meanwhile.

    Raises:
        UserError: there is no place for the cache, others can write to it; when called: it is read-only.
    """
    if interprets():
        return interpreted(function)
    if not parallel and (found := library_of(module_of(function))) is not None:
        return cast(Function, Kernel(function, found, nogil))
    return cast(Function, dispatcher(function, parallel, nogil))


def batch_kernel(function: Function) -> Function:
    """Compile a function of long calls, beside which other threads run; the daemon's cycle calls none."""
    return kernel(function, nogil=True)


def module_of(function: Callable[..., Any]) -> str:
    """Return the name by which the module of a function is imported."""
    spec = find_spec(function.__module__)  # of `python -m package.module`: not `__main__`
    return spec.name if spec else function.__module__


def dispatcher(function: Callable[..., Any], parallel: bool = False, nogil: bool = False) -> Any:
    """Return numba's dispatcher of a kernel, with its cache."""
    numba = compiler()
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _folder(module_of(function))
    made = numba.njit(**OPTIONS, parallel=parallel, nogil=nogil)(function)
    numba.config.CACHE_DIR = before  # functions of others do not go into a folder named after these texts
    return made


class Kernel:
    """A kernel of a library. What was not compiled in there, numba compiles when it is called."""

    def __init__(self, function: Callable[..., Any], found: Library, nogil: bool) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._name = f"{module_of(function)}.{function.__qualname__}"
        self._library, self._nogil = found, nogil

    @cached_property
    def _entries(self) -> list[Entry]:
        return self._library.entries(self._name, self._nogil)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if named:
            bound = signature(self.py_func).bind(*arguments, **named)
            arguments = bound.args
        for entry in self._entries:
            if entry.count == len(arguments) and (block := entry.take(arguments)) is not None:
                return entry.call(block)
        return self.dispatcher(*arguments)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    @cached_property
    def dispatcher(self) -> Any:
        """Return the kernel as numba has it, for what numba compiles and for other arguments."""
        return dispatcher(self.py_func, nogil=self._nogil)

    @property
    def _numba_type_(self) -> Any:
        """Return the kernel's type where numba finds it in a function: that of its dispatcher."""
        return compiler().typeof(self.dispatcher)


class CompileCounter:
    """Counter of compilations, none of which may follow the warm-up; `begins` is called before each."""

    def __init__(self, begins: Callable[[int], None] = lambda count: None) -> None:
        self.count = 0
        self._begins = begins
        before_compiling(self._count)

    def _count(self, dispatcher: Any) -> None:
        self._begins(self.count)
        self.count += 1
