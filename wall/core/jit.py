"""One decorator for every kernel: nopython, GIL released, IEEE division, cached on disk (wall/core/kernel_cache.py)."""

from __future__ import annotations

import atexit
import gc
import importlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

# in the environment: numba forgets other settings when it reads the environment again, which it does when that changed
os.environ.setdefault("NUMBA_THREADING_LAYER", "workqueue")
os.environ.setdefault("NUMBA_SLP_VECTORIZE", "1")  # four neighbours in an array, one instruction

import numba
import numba.np.linalg
from numba.core.ccallback import CFunc
from numba.core.compiler_lock import global_compiler_lock
from numba.core.event import Event, Listener, install_listener, register
from numba.core.sigutils import normalize_signature

from wall.core.garbage import collect_rarely
from wall.core.kernel_cache import KernelCache

numba.config.reload_config()  # type: ignore[no-untyped-call]  # now, not amid a kernel, if numba was imported before
VECTORS: int = numba.config.SLP_VECTORIZE  # type: ignore[attr-defined]
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
    wanted = normalize_signature(signature)  # type: ignore[no-untyped-call]
    made: Any = CFunc(function, wanted, locals={}, options={"error_model": "numpy"})
    made._cache = KernelCache(function)
    made.compile()
    return made


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    compiled = numba.njit(**(OPTIONS | options))(function)
    _kernels[compiled] = VECTORS
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        compiled._cache = KernelCache(function)
    return compiled


def kernels_made() -> int:
    """Kernels that this process knows; about as many are compiled for a run."""
    return len(_kernels)


def specialisations() -> set[str]:
    """Kernels of this process with the types of arguments that each was compiled, or loaded, for."""
    return {f"{k.py_func.__module__}.{k.__name__}{types}" for k in _kernels for types in k.signatures}
