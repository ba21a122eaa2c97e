"""What compositing costs: `depth` against a copy of as many bytes, an unchanged input, a tree of compositors."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from wall.compositing.executor import Executor
from wall.core.data import Framelet, Rect
from wall.operators.depth import Depth
from wall.packets.framelets import bytes_a_pixel
from wall.roles.edges import needed_from_others
from wall.study.speed.depth_tree import layered_graph
from wall.study.speed.record import SEED, Row, bounded, compared, median, reported

FULL_HD = (1920, 1080)


def depth_copy(rounds: int) -> list[Row]:
    """GB/s of `depth` over two 1080p framelets, read and written, against a plain copy of as many bytes."""
    values, limits = _depth(rounds, covering=False)
    note = "two 1920x1080 framelets of random depths, one core, against one memcpy of as many bytes read and written"
    opaque = compared("depth_copy", values, limits, unit="GB/s", at_least=0.6, note=note)
    values, limits = _depth(rounds, covering=True)
    ratio = round(median([value / limit for value, limit in zip(values, limits, strict=True)]), 3)
    note = "the same where each pixel of either is covered whole or not at all, as most of a sort-last layer is"
    return [opaque, reported("depth_covered", median(values), unit="GB/s", note=note, ratio_to_copy=ratio)]


def _depth(rounds: int, *, covering: bool) -> tuple[list[float], list[float]]:
    """GB/s of the operator, and of the copy, in turn."""
    random = np.random.default_rng(SEED)
    rect = Rect(x=0, y=0, width=FULL_HD[0], height=FULL_HD[1])
    size = (rect.height, rect.width)
    channels = frozenset({"colour", "depth", "alpha"} if covering else {"colour", "depth"})
    inputs = [Framelet.blank(rect, channels) for _ in range(2)]
    for framelet in inputs:
        framelet.colour[...] = random.random((*size, 3), np.float32)
        framelet.channel("depth")[...] = random.random(size, np.float32)
        if covering:
            framelet.channel("alpha")[...] = random.random(size) < 0.5
            framelet.colour[...] *= framelet.channel("alpha")[..., None]
    out = Framelet.blank(rect, channels)
    node = Depth(op="depth", id="depth", inputs=("a", "b"))
    moved = 3 * bytes_a_pixel(channels, encoded=False) * rect.area  # two read, one written
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
    return values, limits


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
