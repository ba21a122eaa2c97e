"""One decorator for every kernel: nopython, GIL released, IEEE division, cached on disk.

numba's disk cache checks only the file that a kernel stands in, not the files that it imports from. So each file's
kernels have a cache folder of their own, named by a hash over that file and every `wall` file that it imports: an edit
recompiles what depends on it, and nothing else. A cache that names a class which has moved since counts as empty.
"""

from __future__ import annotations

import atexit
import fcntl
import gc
import hashlib
import importlib
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any
from uuid import uuid4

# in the environment: numba forgets other settings when it reads the environment again, which it does when that changed
os.environ.setdefault("NUMBA_THREADING_LAYER", "workqueue")
os.environ.setdefault("NUMBA_SLP_VECTORIZE", "1")  # four neighbours in an array, one instruction

import numba
import numba.np.linalg
from numba.core.compiler_lock import global_compiler_lock
from numba.core.event import Event, Listener, install_listener, register
from numba.core.runtime.nrt import rtsys

from wall.core.garbage import collect_rarely

numba.config.reload_config()  # type: ignore[no-untyped-call]  # now, not amid a kernel, if numba was imported before
VECTORS: int = numba.config.SLP_VECTORIZE  # type: ignore[attr-defined]
PACKAGE = Path(__file__).resolve().parents[1]
IMPORT = re.compile(rf"^[ \t]*from ({PACKAGE.name}[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
LONGEST_LOCK_S = 2.0  # of an index, held for milliseconds; without it a kernel may be lost, and compiled again
LONGEST_WAIT_S = 5.0  # for a thread that compiles, at the end of a process

# of all kernels; C calls none of them
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, "no_cfunc_wrapper": True}
STRICT = {"fastmath": False}  # IEEE 754 to the letter


def _leave_scipy_out() -> None:
    """Have numba load its array functions without a look for scipy.linalg: 74 modules, 13 MB, 0.1 s at every start.

    A kernel that multiplies matrices still loads it when it is compiled.
    """
    found = numba.np.linalg.ensure_blas
    numba.np.linalg.ensure_blas = lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        numba.np.linalg.ensure_blas = found


_leave_scipy_out()


@atexit.register  # the newest comes first: numba has made the first finalizer by now, so this comes before all of them
def _wait_for_compiler() -> None:
    """Let a thread that compiles finish its kernel, and begin no other, while the interpreter ends.

    What it makes adds to Python's finalizers, which fail to go through them meanwhile.
    """
    global_compiler_lock._lock.acquire(timeout=LONGEST_WAIT_S)  # whose own way to acquire it knows no limit


_used: set[Path] = set()  # cache folders of this process
_kernels: dict[Any, int] = {}  # of this process: whether compiled with vectors of neighbours (SLP)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a pure function of arrays and scalars; it must not raise, log, or read changing globals."""
    return _compiled(function)


def bit_kernel(function: Callable[..., Any]) -> Any:
    """A kernel that packs bits: compiled without vectors of neighbours, which cost it 1.7 times what they save."""
    compiled = _compiled(function)
    _kernels[compiled] = 0
    return compiled


def strict_kernel(function: Callable[..., Any]) -> Any:
    """A kernel that rounds every product and every sum, as written: the same bits however often it is specialised.

    Others fuse a product with the sum that it is added to, and which of two products depends on the code around.
    """
    return _compiled(function, **STRICT)


class _Settings(Listener):
    """While a kernel is compiled: vectors of neighbours (SLP) or none, as suits it, and fewer garbage collections.

    Whoever has it compiled, and whatever numba was told before: the cache keeps it for all.
    """

    def __init__(self) -> None:
        self._before: list[tuple[int, tuple[int, int, int]]] = []

    def on_start(self, event: Event) -> None:
        """Remember the settings, and choose them for the kernel that is about to be compiled."""
        self._before.append((numba.config.SLP_VECTORIZE, gc.get_threshold()))  # type: ignore[attr-defined]
        collect_rarely()  # a sixth of the time of compiling, and no memory
        vectors = _kernels.get(event.data["dispatcher"])
        if vectors is not None:
            numba.config.SLP_VECTORIZE = vectors  # type: ignore[attr-defined]

    def on_end(self, event: Event) -> None:
        """Restore the settings."""
        numba.config.SLP_VECTORIZE, threshold = self._before.pop()  # type: ignore[attr-defined]
        gc.set_threshold(*threshold)


register("numba:compile", _Settings())  # type: ignore[no-untyped-call]


class _Notice(Listener):
    """Calls a function when a kernel is about to be compiled."""

    def __init__(self, act: Callable[[], None]) -> None:
        self._act = act

    def on_start(self, event: Event) -> None:
        """Call it."""
        self._act()

    def on_end(self, event: Event) -> None:
        """Nothing."""


@contextmanager
def when_compiling(act: Callable[[], None]) -> Iterator[None]:
    """Call `act` before each kernel that this process compiles meanwhile: not before those that the cache has."""
    with install_listener("numba:compile", _Notice(act)):
        yield


def strict_inline_kernel(function: Callable[..., Any]) -> Any:
    """An inline_kernel for strict kernels."""
    return inline_kernel(function, **STRICT)


def inline_kernel(function: Callable[..., Any], **options: Any) -> Any:
    """A small kernel that only other kernels call: always inlined; it must not allocate either.

    Without numba's runtime (`_nrt`) no references are counted: otherwise every array that is handed on costs two atomic
    additions a call, 5 ns each, some 250 of them for a packet of 16 rays.
    """
    compiled = _compiled(function, forceinline=True, _nrt=False, no_cpython_wrapper=True, **options)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        compiled._insert = lambda *_: None  # of what Python may call: without a wrapper nothing
        compiled._compile_for_args = lambda *_: _from_python(function)
    return compiled


def lane_kernel(function: Callable[..., Any]) -> Any:
    """An inline_kernel for loops over the 16 lanes of a packet, which become vectors: compiled without vectors of
    neighbours, since LLVM makes no vectors of a loop that has some."""
    compiled = inline_kernel(function)
    _kernels[compiled] = 0
    return compiled


@cache
def _from_python(function: Callable[..., Any]) -> Any:
    """An inline kernel that Python can call, for tests: the wrapper takes a quarter of the time of compiling."""
    return numba.njit(**OPTIONS)(function)


def c_callback(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile a pure function that C calls: numba's CFunc."""
    _choose_cache(function)
    return numba.cfunc(signature, cache=True, error_model="numpy")(function)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    _choose_cache(function)
    compiled = numba.njit(cache=True, **(OPTIONS | options))(function)
    _kernels[compiled] = VECTORS
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        cache = compiled._cache
        cache._cache_file._load_index = _empty_if_outdated(cache._cache_file._load_index)
        cache._cache_file.save = _save_alone(cache._cache_file)
        cache.load_overload = _load_alone(cache._load_overload)
    return compiled


def _choose_cache(function: Callable[..., Any]) -> None:
    """Have numba cache the function that it decorates next in the folder of that function's file."""
    folder = cache_root() / source_hash(Path(function.__code__.co_filename))
    _used.add(folder)
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]


def _load_alone(load: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Loads a kernel from the cache without what compiling alone takes: numba's tables of functions, 0.2 s a process.

    The compiler fills these itself. A loaded kernel calls numba's runtime, and nothing else of it.
    """

    def load_overload(signature: Any, target: Any) -> Any:
        rtsys.initialize(target)
        return load(signature, target)

    return load_overload


def _empty_if_outdated(load_index: Callable[[], dict[Any, str]]) -> Callable[[], dict[Any, str]]:
    """Loads a cache's index, which numba unpickles: without the classes of arguments that it names it is empty."""

    def load() -> dict[Any, str]:
        try:
            return load_index()
        except (AttributeError, ImportError):
            return {}

    return load


def _save_alone(file: Any) -> Callable[[Any, Any], None]:
    """Saves a kernel to a cache that other processes save to at this moment.

    numba numbers files of kernels by an index that it read before. Two processes give two kernels the same file,
    and the index says ever after that the one is the other.
    """

    def save(key: Any, data: Any) -> None:
        name = file._data_name_pattern.replace("{number:d}", uuid4().hex)
        file._save_data(name, data)  # before anybody can look for it
        with locked(Path(f"{file._index_path}.lock"), LONGEST_LOCK_S):
            index = file._load_index()
            if key not in index:
                file._save_index(index | {key: name})
                return
        os.unlink(file._data_path(name))  # another process was faster

    return save


@contextmanager
def locked(path: Path, longest: float) -> Iterator[None]:
    """Hold a file's lock, waited for `longest` seconds at most; after that, or where there are none, go on without."""
    with open(path, "w") as lock:
        limit = time.monotonic() + longest
        while time.monotonic() < limit:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(0.01)
            except OSError:  # this file system has none
                break
        yield


def cache_root() -> Path:
    """The folder of all compiled kernels: wanted_cache_root(), or one of temporary files where it cannot be written.

    Users that services run as often have no home.
    """
    with suppress(OSError, RuntimeError):
        folder = wanted_cache_root()
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    folder = Path(tempfile.gettempdir()) / f"wall-kernels-{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        if folder.lstat().st_uid == os.getuid():  # what it holds is executed
            return folder
    return _cache_of_this_process()


@cache
def _cache_of_this_process() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="wall-kernels-")
    atexit.register(folder.cleanup)
    return Path(folder.name)


def wanted_cache_root() -> Path:
    """$NUMBA_CACHE_DIR, or ~/.cache/wall/kernels. Raises RuntimeError where the user has no home."""
    base = os.environ.get("NUMBA_CACHE_DIR")
    return Path(base) if base else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wall" / "kernels"


@cache
def source_hash(path: Path) -> str:
    """Hash of all that decides what a file's kernels compile to: its text and that of the `wall` files it imports."""
    # numba does not tell bounds-checked builds apart, nor those without vectors of neighbours
    told = f"{os.environ.get('NUMBA_BOUNDSCHECK', '')} {VECTORS}"
    digest = hashlib.sha256((sys.version + numba.__version__ + told).encode())
    for source in sorted(_with_imports(path)):
        digest.update(_digest(source))
    return digest.hexdigest()[:16]


@cache
def _digest(source: Path) -> bytes:
    return hashlib.sha256(source.read_bytes()).digest()


def _with_imports(path: Path) -> set[Path]:
    """A file, this one, and the `wall` files that they import, directly or not."""
    found, ahead = set[Path](), [path.resolve(), Path(__file__).resolve()]
    while ahead:
        if (source := ahead.pop()) not in found:
            found.add(source)
            ahead += _imports(source)
    return found


@cache
def _imports(path: Path) -> list[Path]:
    """The `wall` files that a file imports from; read as text, in a fifteenth of the time that parsing takes."""
    modules = set()
    for module, names in IMPORT.findall(path.read_text(encoding="utf-8")):
        modules |= {module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))}
    files = [PACKAGE.joinpath(*module.split(".")[1:]).with_suffix(".py") for module in sorted(modules)]
    return [file for file in files if file.exists()]


def kernels_made() -> int:
    """Kernels that this process knows; about as many are compiled for a run."""
    return len(_kernels)


def specialisations() -> set[str]:
    """Kernels of this process with the types of arguments that each was compiled, or loaded, for."""
    return {f"{k.py_func.__module__}.{k.__name__}{types}" for k in _kernels for types in k.signatures}


def compiled_kernels() -> int:
    """Compiled kernels in this process's cache folders; one may be there for several argument types."""
    return sum(len(list(folder.rglob("*.nbc"))) for folder in _used if folder.exists())
