"""`wall render`: one converged image, with the same bits for a seed however many threads and ranks share the work."""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from wall.commands.offline import Band, OfflineRenderer
from wall.commands.whole_image import assembled, parts_of
from wall.core.data import Float32
from wall.core.mpi import under_mpi
from wall.roles.plan import Layout, Plan
from wall.run.same_files import check_same
from wall.sampling.pixel_layers import Layer, blank_columns, unstacked
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

if TYPE_CHECKING:
    from wall.run.bootstrap_mpi import MpiBootstrap

Progress = Callable[[int, int], None]  # is told the work done, and all there is
Work: TypeAlias = tuple[OfflineRenderer, Band]


def render(
    plan: Plan,
    *,
    spp: int,
    seed: int,
    at: float,
    size: tuple[int, int] | None = None,
    progress: Progress = lambda done, total: None,
) -> Float32 | None:
    """Render the image at scene time `at`, seconds: (h, w, 3) float32 linear RGB at rank 0, None at other MPI ranks.

    A flat wall of one view is rendered through its plane at `size` (width, height), its height filling the image; other
    walls panel by panel, at pixels that make their image that large. Raises ConfigError.
    """
    found = render_layers(plan, spp=spp, seed=seed, at=at, size=size, progress=progress)
    return None if found is None else found["colour"]


def render_layers(
    plan: Plan,
    *,
    spp: int,
    seed: int,
    at: float,
    size: tuple[int, int] | None = None,
    layers: Sequence[str] = (),
    tracer_scene: TracerScene | None = None,
    progress: Progress = lambda done, total: None,
) -> dict[str, Layer] | None:
    """Render as `render` does, and layers of LAYERS beside it: arrays by name, the image itself is "colour".

    tracer_scene : of the plan's scene; None: it is made

    All arrays are float32: albedo and normal (h, w, 3), depth and variance (h, w); but object_id, (h, w) uint32.
    """
    world = _ranks_of(plan.layout) if under_mpi() else None
    tracer_scene = make_tracer_scene(plan.scene) if tracer_scene is None else tracer_scene
    work: list[Work] = []
    for part in parts_of(plan, size, seed=seed):
        renderer = part.renderer(tracer_scene, spp=spp, at=at, layers=layers)
        work += [(renderer, band) for band in part.bands]
    bands = [band for _, band in work]
    if world is None:
        return unstacked(assembled(bands, _rendered(work, progress), blank_columns(layers)), layers)
    own = _rendered(work[world.rank :: world.size], progress, threads=1)
    received = world.gather(b"".join(band.tobytes() for band in own))
    if received is None:
        return None
    rendered = [np.zeros(0, np.float32)] * len(bands)
    for rank, data in enumerate(received):
        rendered[rank :: world.size] = _unpacked(data, bands[rank :: world.size], len(blank_columns(layers)))
    return unstacked(assembled(bands, rendered, blank_columns(layers)), layers)


def _ranks_of(layout: Layout) -> MpiBootstrap:
    """The ranks of this launch, which all have the same files. Raises ConfigError where they do not."""
    from wall.run.bootstrap_mpi import MpiBootstrap

    world = MpiBootstrap()
    check_same(world, layout, world.allgather(socket.gethostname()))
    return world


def _rendered(work: list[Work], progress: Progress, *, threads: int | None = None) -> list[Float32]:
    """Each band, (h, w, columns) float32: linear RGB, and layers."""
    rendered: list[Float32] = []
    progress(0, len(work))
    for renderer, own in groupby(work, lambda each: each[0]):
        for band in renderer.bands((band for _, band in own), lambda band: band, threads=threads):
            rendered.append(band)
            progress(len(rendered), len(work))
    return rendered


def _unpacked(data: bytes, bands: list[Band], columns: int) -> list[Float32]:
    """The bands that one rank rendered, from the float32 bytes that it sent."""
    values = iter(np.split(np.frombuffer(data, np.float32), np.cumsum([columns * rect.area for _, rect in bands])))
    return [next(values).reshape(rect.height, rect.width, columns) for _, rect in bands]
