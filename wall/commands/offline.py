"""Render converged images offline: any size, as tiles whose bands any number of threads trace.

`wall render`, `wall screenshot` and the references of `wall measure quality` share this renderer. An image is cut into
tiles small enough for float32 pixel positions; an image that fits one tile has the same bits as an uncut one.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64, Rect
from wall.core.errors import ConfigError
from wall.geometry.cameras import PanelView
from wall.geometry.panels import Panel, Plane
from wall.geometry.rects import panel_rect
from wall.roles.plan import Layout, Plan, first_event
from wall.roles.tone import tone_at
from wall.sampling.pixel_layers import SURFACE_LAYERS, PixelLayers, normal_matrices
from wall.sampling.pixel_means import PixelMeans, footprint_of
from wall.tracing.surface_tracer import surface_scene
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import TracerScene

BAND_ROWS = 16  # rows traced at a time: small enough to share evenly, large enough to keep rays coherent
LARGEST_TILE_PIXELS = 8192  # float32 sub-pixel positions stay finer than 1/1024 pixel up to this edge
LOOKAHEAD = 2  # bands for each thread that are submitted before their turn
SEED_STEP = 0x9E3779B1  # odd, so that the seeds of 2^32 tiles all differ


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tile:
    """A rectangle of the image, at most LARGEST_TILE_PIXELS on an edge, described as a panel of its own."""

    panel: Panel  # its `screen` is the tile's top left pixel in the image
    seed: int

    @property
    def rect(self) -> Rect:
        """The tile's rectangle in the image, pixels."""
        (x, y), (width, height) = self.panel.screen, self.panel.pixels
        return Rect(x=x, y=y, width=width, height=height)


Band: TypeAlias = tuple[Tile, Rect]  # a tile and a rectangle in the tile's own pixels
Image: TypeAlias = NDArray[Any]  # (h, w, 3): uint8 sRGB, or float32 linear RGB


def tiles_of(panels: list[Panel], *, seed: int) -> list[Tile]:
    """Cut large panels into tiles. The first tile of each panel keeps the seed, so uncut panels stay as they are."""
    tiles = []
    for panel in panels:
        width, height = panel.pixels
        corners = [(x, y) for y in range(0, height, LARGEST_TILE_PIXELS) for x in range(0, width, LARGEST_TILE_PIXELS)]
        for k, (x, y) in enumerate(corners):
            pixels = (min(LARGEST_TILE_PIXELS, width - x), min(LARGEST_TILE_PIXELS, height - y))
            part = replace(panel, pixels=pixels, screen=(panel.screen[0] + x, panel.screen[1] + y))
            tiles.append(Tile(panel=part, seed=(seed + k * SEED_STEP) & 0xFFFFFFFF))
    return tiles


def bands_of(tile: Tile, first: int = 0, end: int | None = None) -> Iterator[Band]:
    """Bands of BAND_ROWS that cover the tile's rows from `first` to `end`; all rows by default."""
    width, height = tile.panel.pixels
    end = height if end is None else min(end, height)
    for y in range(max(0, first), end, BAND_ROWS):
        yield tile, Rect(x=0, y=y, width=width, height=min(BAND_ROWS, end - y))


def image_size(panels: Iterable[Panel]) -> tuple[int, int]:
    """Width and height of the image that holds all panels, pixels."""
    corners = [(p.screen[0] + p.pixels[0], p.screen[1] + p.pixels[1]) for p in panels]
    return max(x for x, _ in corners), max(y for _, y in corners)


def panels_of(layout: Layout, size: tuple[int, int] | None, *, scale: float = 1.0) -> list[Panel]:
    """The panels to render: one that covers the whole flat wall at the wanted size, else the wall's own, scaled to it.

    size : width and height of the image, pixels; a flat wall's height fills it. None: the wall's own size
    scale : factor on the pixels of both axes, without a `size`

    Raises ConfigError for a `size` of another shape than the wall's image where its panels stand at angles, or are seen
    from several eyes.
    """
    wall, found = layout.wall, layout.wall.whole()
    if found is None and size is not None:
        scale, size = scale_to(size, layout), None
    if found is None or (size is None and len(wall.faces) > 1):
        return [scaled(panel, scale, panel.span) for panel in wall.panels]
    width, height = size or (max(1, round(scale * found.width)), max(1, round(scale * found.height)))
    per, own = found.height / height, found.plane
    left = found.width / 2 - per * width / 2
    plane = Plane(origin=own.origin + left * own.per_x, per_x=own.per_x * per, per_y=own.per_y * per)
    return [replace(wall.panels[0], pixels=(width, height), screen=(0, 0), plane=plane)]


def view_panels(layout: Layout, view: int, scale: float) -> list[Panel]:
    """What shows a view, in the scaled image of the wall: one panel without bezels, if nothing else is in its place."""
    shown = layout.wall.of_view(view).panels
    left, top = (min(panel.screen[axis] for panel in shown) for axis in (0, 1))
    right, bottom = (max(panel.screen[axis] + panel.span[axis] for panel in shown) for axis in (0, 1))
    place, first = Rect(x=left, y=top, width=right - left, height=bottom - top), shown[0]
    others = (panel_rect(panel) for panel in layout.wall.panels if panel.view != view and shown[0].inset_of is None)
    apart = any(p.plane is not first.plane or p.sight != first.sight or p.pixels != p.span for p in shown)
    if apart or any(rect.intersection(place) for rect in others):
        return [scaled(panel, scale, panel.span) for panel in shown]
    size = (place.width, place.height)
    return [scaled(replace(first, pixels=size, screen=(left, top), span=size), scale)]


def scale_to(size: tuple[int, int], layout: Layout) -> float:
    """The factor on all pixels that makes the wall's image of that size. Raises ConfigError."""
    wall = layout.wall
    scale = size[0] / wall.width
    height = max(1, round(scale * wall.height))
    if size[1] != height:
        why = "stand at angles" if not wall.flat else "are seen from several eyes"
        why = "show several views" if len(layout.config.views) > 1 else why
        raise ConfigError(
            f"{layout.loaded.path}: --size {size[0]}x{size[1]}: these panels {why}, so all of them are shown, "
            f"{wall.width}x{wall.height}; wanted: a size of that shape, such as {size[0]}x{height}"
        )
    return scale


def scaled(panel: Panel, scale: float, span: tuple[int, int] | None = None) -> Panel:
    """Scale a panel's pixel counts and screen position, rounded to whole pixels; its lit area in metres stays.

    span : width and height to scale, such as its own in the wall's image; None: its pixels
    """
    span = span or panel.pixels
    if scale == 1.0 and span == panel.pixels:
        return panel
    (w, h), plane = panel.pixels, panel.plane
    (left, top), (x, y) = panel.screen, (round(scale * each) for each in panel.screen)
    width, height = max(1, round(scale * (left + span[0])) - x), max(1, round(scale * (top + span[1])) - y)
    per_x, per_y = plane.per_x * (w / width), plane.per_y * (h / height)
    origin = plane.point(*panel.screen) - x * per_x - y * per_y
    return replace(panel, pixels=(width, height), screen=(x, y), plane=Plane(origin=origin, per_x=per_x, per_y=per_y))


def event_at(plan: Plan, at: float) -> Event:
    """The event of what the view shows `at` seconds after a run began, through its camera path."""
    time, first = plan.view.time_after(at), first_event(plan, 0.0)
    tone, camera = tone_at(plan, time), plan.view.camera_after(at)
    return replace(first, scene_time=time, camera=camera, exposure=tone.stops, tone_mapping=tone.mapping)


class OfflineRenderer:
    """Renders bands of tiles under one event; threads may call at once, each gets its own tracer."""

    def __init__(
        self, plan: Plan, tracer_scene: TracerScene, event: Event, *, spp: int, layers: Sequence[str] = ()
    ) -> None:
        """`spp`: samples a pixel; `layers`: of LAYERS. `event` may be replaced while no band is being rendered."""
        self.event = event
        self._plan, self._tracer_scene, self._spp, self._layers = plan, tracer_scene, spp, layers
        self._surface_scene = surface_scene(tracer_scene) if SURFACE_LAYERS & set(layers) else None
        self._local, self._surfaces_local = threading.local(), threading.local()

    def band(self, tile: Tile, rect: Rect, stopped: threading.Event | None = None) -> Float64:
        """(h, w, 3) float64 linear RGB, the mean of each pixel's samples. Raises CancelledError once `stopped`."""
        tracer, sampler = self._tracer(self._local, self._tracer_scene, tile), PixelMeans(rect, seed=tile.seed)
        for sample in self._numbers(stopped):
            sampler.add(tracer.trace(sampler.positions(sample), footprint_of(self._spp), sample)[0])
        return sampler.mean()

    def band_with_layers(self, tile: Tile, rect: Rect, stopped: threading.Event | None = None) -> Float32:
        """(h, w, columns) float32: the band and its layers, see pixel_layers.unstacked."""
        layers, means = PixelLayers(rect, self._layers), PixelMeans(rect, seed=tile.seed)
        tracer, surfaces = self._tracer(self._local, self._tracer_scene, tile), None
        if self._surface_scene is not None:
            surfaces = self._tracer(self._surfaces_local, self._surface_scene, tile)
            moment = self._plan.scene.at(self.event.scene_time, self.event.edits)
            matrices = normal_matrices(moment.world_from_object)
        for sample in self._numbers(stopped):
            xy = means.positions(sample)
            samples = tracer.trace(xy, footprint_of(self._spp), sample)[0]
            means.add(samples)
            layers.add(samples)
            if surfaces is not None:
                layers.add_surfaces(surfaces.trace(xy, footprint_of(self._spp), sample)[0], matrices)
        return layers.stacked(means)

    def _numbers(self, stopped: threading.Event | None) -> Iterator[int]:
        """The samples of a pixel."""
        for number in range(self._spp):
            if stopped is not None and stopped.is_set():
                raise CancelledError
            yield number

    def bands(
        self, work: Iterable[Band], finish: Callable[[Float32], Image], *, threads: int | None = None
    ) -> Iterator[Image]:
        """Render bands and layers in parallel and yield them in order, each passed through `finish` by its thread.

        At most LOOKAHEAD bands a thread wait for their turn. `threads`: None for all cores of this process.
        """

        def render(band: Band) -> Image:
            if self._layers:
                return finish(self.band_with_layers(*band, stopped))
            return finish(self.band(*band, stopped).astype(np.float32))

        stopped = threading.Event()  # nobody waits for these bands any more
        count = threads or len(os.sched_getaffinity(0))
        pending = iter(work)
        with ThreadPoolExecutor(count) as pool:
            begun = deque(pool.submit(render, band) for band in islice(pending, LOOKAHEAD * count))
            try:
                while begun:
                    yield begun.popleft().result()
                    begun.extend(pool.submit(render, band) for band in islice(pending, 1))
            finally:
                stopped.set()
                for future in begun:
                    future.cancel()

    def _tracer(self, local: Any, tracer_scene: TracerScene, tile: Tile) -> Tracer:
        """The tracer that a thread keeps in `local`, set to the tile and the event."""
        if getattr(local, "tile", None) is tile and local.event is self.event:
            return local.tracer  # type: ignore[no-any-return]
        panel_view = PanelView(self._plan.view, tile.panel)
        if not hasattr(local, "tracer"):
            local.tracer = Tracer(tracer_scene, tile.panel, panel_view.eye, coherent=True)
        local.tracer.look_through(tile.panel, panel_view.eye, panel_view(self.event))
        local.tile, local.event, local.tracer.seed = tile, self.event, tile.seed
        return local.tracer  # type: ignore[no-any-return]
