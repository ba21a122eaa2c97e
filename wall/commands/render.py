"""`wall render`: one converged picture, the same bits for a seed however many threads and ranks share the work."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from wall.commands.offline import Drawing, Piece, pieces, whole
from wall.config.loading import Loaded
from wall.core.data import Float32, Rect
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.bootstrap import under_mpi
from wall.tracing.tracer_scene import make_tracer_scene

BAND_ROWS = 16  # rows of one piece of work

Progress = Callable[[int, int], None]


def render(
    loaded: Loaded, *, spp: int, seed: int, size: tuple[int, int] | None, at: float, progress: Progress
) -> Float32 | None:
    """The picture at scene time `at` seconds: (h, w, 3) float32 linear RGB at rank 0, None at other MPI ranks.

    A flat wall is drawn through its plane at `size` (width, height), keeping the wall's height in view; other walls
    panel by panel at their own pixels. Raises ConfigError.
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
    parts = pieces(whole(plan.layout, size), seed=seed)
    drawing = Drawing(plan, make_tracer_scene(plan.scene), spp=spp, at=at)
    bands = [(piece, band) for piece in parts for band in _bands(piece)]
    if not under_mpi():
        rendered = _render_bands(drawing, bands, progress)
    else:
        from wall.run.bootstrap_mpi import MpiBootstrap

        world = MpiBootstrap()
        mine = _render_bands(drawing, bands[world.rank :: world.size], progress, threads=1)
        gathered = world.gather(b"".join(band.tobytes() for band in mine))
        if gathered is None:
            return None
        rendered = [np.zeros(0, np.float32)] * len(bands)
        for rank, data in enumerate(gathered):
            rendered[rank :: world.size] = _unpack(data, bands[rank :: world.size])
    return _assemble(bands, rendered)


def _bands(piece: Piece) -> list[Rect]:
    width, height = piece.panel.pixels
    return [Rect(x=0, y=y, width=width, height=min(BAND_ROWS, height - y)) for y in range(0, height, BAND_ROWS)]


def _render_bands(
    drawing: Drawing, bands: list[tuple[Piece, Rect]], progress: Progress, *, threads: int | None = None
) -> list[Float32]:
    count = max(1, min(threads or len(os.sched_getaffinity(0)), len(bands)))
    rendered: dict[int, Float32] = {}

    def work(share: range) -> None:
        for k in share:
            rendered[k] = drawing.band(*bands[k])
            progress(len(rendered), len(bands))

    with ThreadPoolExecutor(count) as pool:
        for future in [pool.submit(work, range(k, len(bands), count)) for k in range(count)]:
            future.result()
    return [rendered[k] for k in range(len(bands))]


def _unpack(data: bytes, bands: list[tuple[Piece, Rect]]) -> list[Float32]:
    values, parts, start = np.frombuffer(data, np.float32), [], 0
    for _, rect in bands:
        parts.append(values[start : start + 3 * rect.area].reshape(rect.height, rect.width, 3))
        start += 3 * rect.area
    return parts


def _assemble(bands: list[tuple[Piece, Rect]], rendered: list[Float32]) -> Float32:
    width, height = max(p.rect.right for p, _ in bands), max(p.rect.bottom for p, _ in bands)
    picture = np.zeros((height, width, 3), np.float32)
    for (piece, rect), band in zip(bands, rendered, strict=True):
        x, y = piece.rect.x + rect.x, piece.rect.y + rect.y
        picture[y : y + rect.height, x : x + rect.width] = band
    return picture
