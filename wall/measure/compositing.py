"""What compositing costs: `depth` against a copy of as many bytes, an unchanged input, a tree of compositors."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from wall.compositing.executor import Executor
from wall.data import Framelet, Rect
from wall.measure.depth_tree import layered_graph
from wall.measure.record import SEED, Row, bounded, compared
from wall.operators.depth import Depth
from wall.processes.edges import needed_from_others

FULL_HD = (1920, 1080)


def depth_copy(rounds: int) -> list[Row]:
    """GB/s of `depth` over two opaque 1080p framelets, read and written, against a plain copy of as many bytes."""
    random = np.random.default_rng(SEED)
    rect = Rect(x=0, y=0, width=FULL_HD[0], height=FULL_HD[1])
    size = (rect.height, rect.width)
    inputs = [
        Framelet(
            rect=rect, colour=random.random((*size, 3), np.float32), depth=random.random(size, np.float32)
        )
        for _ in range(2)
    ]  # fmt: skip
    out = Framelet.blank(rect, frozenset({"colour", "depth"}))
    node = Depth(op="depth", id="depth", inputs=("a", "b"))
    moved = 3 * 16 * rect.area  # bytes: two read, one written
    source = np.ones(moved // 2, np.uint8)
    target = np.zeros_like(source)
    node.apply(inputs, out, rect, None)
    values, limits = [], []
    for _ in range(rounds):
        began = time.perf_counter()
        np.copyto(target, source)
        between = time.perf_counter()
        node.apply(inputs, out, rect, None)
        done = time.perf_counter()
        limits.append(moved / (between - began) / 1e9)
        values.append(moved / (done - between) / 1e9)
    note = "two 1920x1080 framelets of random depths, one core, against one memcpy of as many bytes read and written"
    return [compared("depth_copy", values, limits, unit="GB/s", at_least=0.6, note=note)]


def unchanged_input(rounds: int) -> list[Row]:
    """Pixels that the nodes after eight unchanged sources write at a refresh."""
    graph = layered_graph(tree=False)
    sources = {s.index: Framelet.blank(s.rect, s.channels) for s in needed_from_others(graph, 0)}
    executor = Executor(graph, 0, sources, Path())
    executor.step({k: [f.rect] for k, f in sources.items()}, None)
    written, began = executor.pixels, time.perf_counter()
    for _ in range(1000 * rounds):
        executor.step({}, None)
    micros = 1e6 * (time.perf_counter() - began) / (1000 * rounds)
    note = f"eight sources, depth and a sink; {micros:.0f} us a refresh to find that nothing changed"
    pixels = float(executor.pixels - written)
    return [bounded("unchanged_input", pixels, 0.0, unit="pixels", below=True, note=note, micros=round(micros, 2))]
