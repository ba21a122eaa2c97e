"""Compiled kernels on disk, by numba's own cache, in folders that are named by all that decides what they hold.

numba's disk cache checks only the file that a kernel stands in, not the files that it imports from. So each file's
kernels have a cache folder of their own, named by a hash over that file and every `wall` file that it imports: an edit
recompiles what depends on it, and nothing else. A cache that names a class which has moved since counts as empty.

A folder is looked at when a kernel is first called or compiled: most of the 400 or so kernels that a process declares
never are. The hash is of the sources as they are when a kernel is declared: they may be others when it is called.
"""

from __future__ import annotations

import atexit
import fcntl
import hashlib
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, UserProvidedCacheLocator
from numba.core.runtime.nrt import rtsys

PACKAGE = Path(__file__).resolve().parents[1]
IMPORT = re.compile(rf"^[ \t]*from ({PACKAGE.name}[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
LONGEST_LOCK_S = 2.0  # of an index, held for milliseconds; without it a kernel may be lost, and compiled again
STAMP = ""  # of all sources: the name of their folder says which they are
DECORATORS = PACKAGE / "core" / "jit.py"  # how kernels are compiled

_sources: set[Path] = set()  # files with kernels of this process


class KernelCache:
    """A function's compiled kernels: numba's cache, made when the first is looked for."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, source = function, Path(function.__code__.co_filename)
        source_hash(source)  # known from now on
        _sources.add(source)

    @cached_property
    def _cache(self) -> FunctionCache:
        return _Cache(self._function)

    @property
    def cache_path(self) -> str:
        """The folder of the function's kernels."""
        path: str = self._cache.cache_path
        return path

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Load a kernel without what compiling alone takes: numba's tables of functions, 0.2 s a process.

        The compiler fills these itself. A loaded kernel calls numba's runtime, and nothing else of it.
        """
        rtsys.initialize(target)
        with suppress(OSError):  # of a folder that another user made: it is compiled again
            return self._cache._load_overload(signature, target)
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Save a kernel to a cache that others save to at this moment; where that cannot be, it is not kept."""
        with suppress(OSError):
            self._cache.save_overload(signature, compiled)


class _Locator(UserProvidedCacheLocator):
    """Where the kernels of a function's file are; nothing is written there before there is one to save."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        self._cache_path = str(folder_of(Path(file)))

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> _Locator:
        return cls(function, file)


class _Files(CompileResultCacheImpl):
    def __init__(self, function: Callable[..., Any]) -> None:
        self._locator_classes = [_Locator]
        super().__init__(function)


class _Index(IndexDataCacheFile):
    """A function's index of kernels, and their files."""

    def _load_index(self) -> dict[Any, str]:
        """What numba unpickles: without the classes of arguments that it names it is empty."""
        try:
            index: dict[Any, str] = super()._load_index()
        except (AttributeError, ImportError):
            return {}
        return index

    def save(self, key: Any, data: Any) -> None:
        """Save a kernel under a name of its own.

        numba numbers files of kernels by an index that it read before. Two processes give two kernels the same file,
        and the index says ever after that the one is the other.
        """
        name = self._data_name_pattern.replace("{number:d}", uuid4().hex)
        self._save_data(name, data)  # before anybody can look for it
        known = False
        try:
            with locked(Path(f"{self._index_path}.lock"), LONGEST_LOCK_S):
                index = self._load_index()
                if key not in index:  # else another process was faster
                    self._save_index(index | {key: name})
                    known = True
        finally:
            if not known:
                os.unlink(self._data_path(name))


class _Cache(FunctionCache):
    _impl_class = _Files

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _Index(self._cache_path, self._impl.filename_base, STAMP)


def folder_of(source: Path) -> Path:
    """The folder of the kernels in a file."""
    return _root_of(*map(os.environ.get, ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"))) / source_hash(source)


@cache
def _root_of(*environment: str | None) -> Path:
    """cache_root() under these variables: looked for once, not for each file."""
    return cache_root()


def compiled_kernels() -> int:
    """Compiled kernels in this process's cache folders; one may be there for several argument types."""
    return sum(len(list(folder_of(source).glob("*.nbc"))) for source in tuple(_sources))


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
    told = f"{os.environ.get('NUMBA_BOUNDSCHECK', '')} {os.environ.get('NUMBA_SLP_VECTORIZE', '')}"
    digest = hashlib.sha256((sys.version + numba.__version__ + told).encode())
    for source in sorted(_with_imports(path)):
        digest.update(_digest(source))
    return digest.hexdigest()[:16]


@cache
def _digest(source: Path) -> bytes:
    return hashlib.sha256(source.read_bytes()).digest()


def _with_imports(path: Path) -> set[Path]:
    """A file, this one, and the `wall` files that they import, directly or not."""
    found, ahead = set[Path](), [path.resolve(), DECORATORS]
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


