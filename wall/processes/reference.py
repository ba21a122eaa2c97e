"""`wall render`: one converged picture, the same bits for a seed however many threads and ranks share the work."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from wall.config.loading import Loaded
from wall.data import Event, Float32, Rect
from wall.errors import ConfigError
from wall.geometry.cameras import Standpoint
from wall.geometry.outlines import whole
from wall.geometry.panels import Panel, Plane
from wall.processes.bootstrap import under_mpi
from wall.processes.plan import Layout, Plan, first_event, make_layout, make_plan
from wall.sampling.progressive import ProgressiveSampler
from wall.tracing.resident import Resident, make_resident
from wall.tracing.tracer import Tracer

BAND_ROWS = 16  # rows of one piece of work
FLOAT32_EXACT_PIXELS = 8192  # sub-pixel positions stay finer than 1/1024 pixel up to here

Progress = Callable[[int, int], None]


def render(
    loaded: Loaded, *, spp: int, seed: int, size: tuple[int, int] | None, at: float, progress: Progress
) -> Float32 | None:
    """The picture at scene time `at` seconds: (h, w, 3) float32 linear RGB at rank 0, None at other MPI ranks.

    A flat wall that one eye sees is drawn through its plane at `size` (width, height), keeping the wall's height in
    view; other walls panel by panel at their own pixels. Raises ConfigError.
    """
    plan = make_plan(make_layout(loaded))
    return render_plan(plan, spp=spp, seed=seed, size=size, at=at, progress=progress)


def render_plan(
    plan: Plan,
    *,
    spp: int,
    seed: int,
    at: float,
    size: tuple[int, int] | None = None,
    progress: Progress = lambda done, total: None,
) -> Float32 | None:
    """The same for a plan whose scene is loaded."""
    resident = make_resident(plan.scene)
    event = replace(first_event(plan, 0.0), scene_time=at, camera=plan.view.camera_at(at))
    pieces = _pieces(plan.layout, size)
    bands = [(panel, band) for panel in pieces for band in _bands(panel)]
    if not under_mpi():
        rendered = _render_bands(plan, resident, event, bands, spp, seed, progress)
    else:
        from wall.processes.bootstrap_mpi import MpiBootstrap

        world = MpiBootstrap()
        mine = _render_bands(plan, resident, event, bands[world.rank :: world.size], spp, seed, progress, threads=1)
        gathered = world.gather(b"".join(band.tobytes() for band in mine))
        if gathered is None:
            return None
        rendered = [np.zeros(0, np.float32)] * len(bands)
        for rank, data in enumerate(gathered):
            rendered[rank :: world.size] = _unpack(data, bands[rank :: world.size])
    return _assemble(pieces, bands, rendered)


def _pieces(layout: Layout, size: tuple[int, int] | None) -> list[Panel]:
    """The rectangles to draw: one that is the whole flat wall at the wanted size, or the panels themselves."""
    wall = layout.wall
    found = whole(wall)
    if found is None and size is not None:
        why = "are seen from several eyes" if wall.flat else "stand at angles"
        raise ConfigError(f"{layout.loaded.path}: --size needs a flat wall, and these panels {why}; leave it out")
    if found is None or (size is None and len(wall.faces) > 1):
        return list(wall.panels)
    width, height = size or (found.width, found.height)
    scale, own = found.height / height, found.plane
    left = found.width / 2 - scale * width / 2
    plane = Plane(origin=own.origin + left * own.per_x, per_x=own.per_x * scale, per_y=own.per_y * scale)
    return [replace(wall.panels[0], pixels=(width, height), screen=(0, 0), plane=plane)]


def _bands(panel: Panel) -> list[Rect]:
    width, height = panel.pixels
    if max(width, height) > FLOAT32_EXACT_PIXELS:
        raise ConfigError(f"a picture of {width}x{height} pixels: at most {FLOAT32_EXACT_PIXELS} on an edge")
    return [Rect(x=0, y=y, width=width, height=min(BAND_ROWS, height - y)) for y in range(0, height, BAND_ROWS)]


def _render_bands(
    plan: Plan,
    resident: Resident,
    event: Event,
    bands: list[tuple[Panel, Rect]],
    spp: int,
    seed: int,
    progress: Progress,
    *,
    threads: int | None = None,
) -> list[Float32]:
    count = max(1, min(threads or len(os.sched_getaffinity(0)), len(bands)))
    rendered: dict[int, Float32] = {}

    def work(share: range) -> None:
        tracer, drawn = None, None
        for k in share:
            panel, rect = bands[k]
            if tracer is None or drawn is not panel:
                seen, drawn = Standpoint(plan.view, panel), panel
                tracer = Tracer(resident, panel, seen.eye, coherent=True)
                tracer.take(seen(event))
            sampler = ProgressiveSampler(rect, seed=seed)
            for sample in range(spp):
                sampler.add(tracer.trace(sampler.positions(sample))[0])
            rendered[k] = sampler.mean().astype(np.float32)
            progress(len(rendered), len(bands))

    with ThreadPoolExecutor(count) as pool:
        for future in [pool.submit(work, range(k, len(bands), count)) for k in range(count)]:
            future.result()
    return [rendered[k] for k in range(len(bands))]


def _unpack(data: bytes, bands: list[tuple[Panel, Rect]]) -> list[Float32]:
    values, parts, start = np.frombuffer(data, np.float32), [], 0
    for _, rect in bands:
        parts.append(values[start : start + 3 * rect.area].reshape(rect.height, rect.width, 3))
        start += 3 * rect.area
    return parts


def _assemble(pieces: list[Panel], bands: list[tuple[Panel, Rect]], rendered: list[Float32]) -> Float32:
    width = max(p.screen[0] + p.pixels[0] for p in pieces)
    height = max(p.screen[1] + p.pixels[1] for p in pieces)
    picture = np.zeros((height, width, 3), np.float32)
    for (panel, rect), band in zip(bands, rendered, strict=True):
        x, y = panel.screen[0] + rect.x, panel.screen[1] + rect.y
        picture[y : y + rect.height, x : x + rect.width] = band
    return picture
