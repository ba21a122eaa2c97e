"""`wall render`: one converged image, with the same bits for a seed however many threads and ranks share the work."""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from wall.commands.offline import Band, OfflineRenderer, bands_of, event_at, image_size, panels_of, tiles_of
from wall.core.data import Float32
from wall.roles.plan import Layout, Plan
from wall.run.bootstrap import under_mpi
from wall.run.same_files import check_same
from wall.tracing.tracer_scene import make_tracer_scene

if TYPE_CHECKING:
    from wall.run.bootstrap_mpi import MpiBootstrap

Progress = Callable[[int, int], None]  # is told the work done, and all there is


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

    A flat wall is rendered through its plane at `size` (width, height), its height filling the image; other walls
    panel by panel at their own pixels. Raises ConfigError.
    """
    world = _ranks_of(plan.layout) if under_mpi() else None
    panels = panels_of(plan.layout, size)
    bands = [band for tile in tiles_of(panels, seed=seed) for band in bands_of(tile)]
    renderer = OfflineRenderer(plan, make_tracer_scene(plan.scene), event_at(plan, at), spp=spp)
    if world is None:
        return _assembled(bands, _rendered(renderer, bands, progress))
    own = _rendered(renderer, bands[world.rank :: world.size], progress, threads=1)
    received = world.gather(b"".join(band.tobytes() for band in own))
    if received is None:
        return None
    rendered = [np.zeros(0, np.float32)] * len(bands)
    for rank, data in enumerate(received):
        rendered[rank :: world.size] = _unpacked(data, bands[rank :: world.size])
    return _assembled(bands, rendered)


def _ranks_of(layout: Layout) -> MpiBootstrap:
    """The ranks of this launch, which all have the same files. Raises ConfigError where they do not."""
    from wall.run.bootstrap_mpi import MpiBootstrap

    world = MpiBootstrap()
    check_same(world, layout, world.allgather(socket.gethostname()))
    return world


def _rendered(
    renderer: OfflineRenderer, bands: list[Band], progress: Progress, *, threads: int | None = None
) -> list[Float32]:
    """Each band, (h, w, 3) float32 linear RGB."""
    rendered: list[Float32] = []
    for band in renderer.bands(bands, lambda band: band, threads=threads):
        rendered.append(band)
        progress(len(rendered), len(bands))
    return rendered


def _unpacked(data: bytes, bands: list[Band]) -> list[Float32]:
    """The bands that one rank rendered, from the float32 bytes that it sent."""
    values = iter(np.split(np.frombuffer(data, np.float32), np.cumsum([3 * rect.area for _, rect in bands])))
    return [next(values).reshape(rect.height, rect.width, 3) for _, rect in bands]


def _assembled(bands: list[Band], rendered: list[Float32]) -> Float32:
    """Put the bands in their places of the image; pixels of no band are black."""
    width, height = image_size(tile.panel for tile, _ in bands)
    image = np.zeros((height, width, 3), np.float32)
    for (tile, rect), band in zip(bands, rendered, strict=True):
        x, y = tile.rect.x + rect.x, tile.rect.y + rect.y
        image[y : y + rect.height, x : x + rect.width] = band
    return image
