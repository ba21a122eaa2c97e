"""One decorator for every kernel: nopython, GIL released, IEEE division, cached on disk.

numba's cache checks only the file that a kernel stands in, not the files it imports from, so the cache folder is
named by a hash over the sources of all kernels: any edit starts a fresh folder.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1]


def kernel_sources() -> list[Path]:
    """Every file whose text decides what a kernel compiles to."""
    others = ["tracing/embree.py", "scene/sky.py", "core/jit.py", "core/data.py"]
    return sorted([*PACKAGE.rglob("kernels/*.py"), *(PACKAGE / name for name in others)])


def cache_folder() -> Path:
    """Where compiled kernels are kept: $NUMBA_CACHE_DIR or ~/.cache/wall/kernels, then the sources' hash."""
    # numba does not tell bounds-checked builds apart
    digest = hashlib.sha256((sys.version + os.environ.get("NUMBA_BOUNDSCHECK", "")).encode())
    for path in kernel_sources():
        if path.exists():
            digest.update(path.read_bytes())
    base = os.environ.get("NUMBA_CACHE_DIR")
    root = Path(base) if base else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wall" / "kernels"
    return root / digest.hexdigest()[:16]


_folder = cache_folder()
os.environ.setdefault("NUMBA_THREADING_LAYER", "workqueue")

import numba  # noqa: E402  (the cache folder must be known first)

numba.config.CACHE_DIR = str(_folder)  # type: ignore[attr-defined]
numba.config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]  # four neighbours in an array, one instruction


_made = 0


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a pure function of arrays and scalars; it must not raise, log, or read changing globals."""
    return _compiled(function)


def inline_kernel(function: Callable[..., Any]) -> Any:
    """A small kernel that only other kernels call: always inlined; it must not allocate either.

    Without numba's runtime (`_nrt`) no references are counted: otherwise every array that is handed on costs two atomic
    additions a call, 5 ns each, some 250 of them for a packet of 16 rays.
    """
    return _compiled(function, forceinline=True, _nrt=False)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    global _made
    _made += 1
    return numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, **options)(function)


def kernels_made() -> int:
    """How many kernels this process knows; about as many are compiled for a run."""
    return _made


def compiled_kernels() -> int:
    """How many specialisations lie in the cache folder."""
    return len(list(_folder.rglob("*.nbc"))) if _folder.exists() else 0
