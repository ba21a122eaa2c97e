"""The ideal pictures: the exact refresh time, no latency, many samples a pixel; kept on disk.

A file is named by a hash of all that decides its pixels, so a changed scene or tracer never meets an old picture.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wall.config.loading import dump
from wall.jit import PACKAGE
from wall.measure.quality.arm import Setup
from wall.processes.reference import render_plan

SPP = 64
SEED = 64_000_001  # of the ideal pictures; arms have others
SOURCES = ("tracing", "scene", "geometry")  # what decides a traced pixel

Frames = NDArray[np.float16]  # (n, h, w, 3) linear RGB


def folder() -> Path:
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wall" / "quality"
    root.mkdir(parents=True, exist_ok=True)
    return root


def ideal(setup: Setup, times: list[float], *, spp: int = SPP, progress: Callable[[int, int], None]) -> Frames:
    """The ideal picture at every time: read from the cache, or rendered and kept there. float16: 11 bits."""
    path = folder() / f"{_key(setup, times, spp)}.npy"
    if not path.exists():
        width, height = setup.size
        part = path.with_suffix(f".{os.getpid()}.part")
        frames = np.lib.format.open_memmap(part, mode="w+", dtype=np.float16, shape=(len(times), height, width, 3))
        for k, time in enumerate(times):
            frames[k] = np.minimum(render_plan(setup.plan, spp=spp, seed=SEED, at=time), 6e4)
            progress(k + 1, len(times))
        frames.flush()
        del frames
        part.replace(path)
    loaded: Frames = np.load(path, mmap_mode="r")
    return loaded


def _key(setup: Setup, times: list[float], spp: int) -> str:
    layout = setup.plan.layout
    digest = hashlib.sha256(dump(layout.loaded.config).encode())
    digest.update(repr((setup.size, [round(t, 9) for t in times], spp, SEED)).encode())
    model = Path(layout.loaded.path).parent / layout.config.scene.source
    if model.is_file():
        digest.update(model.read_bytes())
    for name in SOURCES:
        for path in sorted((PACKAGE / name).glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:24]
