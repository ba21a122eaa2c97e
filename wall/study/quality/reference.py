"""The reference images of a scene: converged, traced for the exact time of each scored refresh, kept on disk.

They depend on nothing that methods do. A cache entry is named by a hash of what the tracer is given (geometry, looks,
every pose and camera) and of the tracer's own text, so a changed scene or tracer starts a new one. Images are
float16: within 2^-11 of their float32 values, a seventh of the smallest step that 8 bits can show.

Images of paths are noisy themselves: each is two, of half the samples and other random numbers. The product of the
differences to both is free of the reference's own noise on average, where the square of one difference would add it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wall.commands.offline import OfflineRenderer, Tile, bands_of
from wall.core.data import Event, Float32, Float64, Rect
from wall.core.kernel_cache import PACKAGE
from wall.geometry.cameras import PanelView
from wall.geometry.panels import Panel
from wall.roles.plan import Plan
from wall.study.quality.method import Inputs
from wall.tracing.tracer_scene import TracerScene

SAMPLES_A_PIXEL = 64
SEED = 20050629  # of every reference image, whatever the methods' seeds
LARGEST = 65504.0  # of float16: brighter light is kept as this
SMALL_PIXELS = 100_000  # up to here every 2nd refresh is scored, above every 8th
SMALL_STRIDE, LARGE_STRIDE = 2, 8
TRACER_SOURCES = (
    "tracing",
    "commands/offline.py",
    "sampling/pixel_means.py",
    "sampling/kernels/permutation.py",
    "geometry/frusta.py",
    "scene/kernels",
)


def reference_refreshes(size: tuple[int, int], *, seconds: float, refresh_hz: float) -> tuple[int, ...]:
    """Numbers of the refreshes that have a reference image, 0 included."""
    stride = SMALL_STRIDE if size[0] * size[1] <= SMALL_PIXELS else LARGE_STRIDE
    return tuple(range(0, int(seconds * refresh_hz + 1e-6) + 1, stride))


class Reference:
    """Reference images at given times; `make` traces those that are not there yet."""

    def __init__(
        self, plan: Plan, tracer_scene: TracerScene, times: Iterable[float], *, spp: int = SAMPLES_A_PIXEL,
        panel: int = 0, cache: Path | None = None,
    ) -> None:  # fmt: skip
        """`times` (seconds, growing) are those of the images, in order; `cache` is another folder to keep them in.

        Where a display shows one row after the other, they are those of its first row.
        """
        self._plan, self._tracer_scene, self._spp = plan, tracer_scene, spp
        self._panel = plan.layout.wall.panels[panel]
        self._halves = 1 if plan.scene.path_depth is None else 2
        inputs, self.times = Inputs(plan), tuple(times)
        self.events: tuple[Event, ...] = tuple(inputs.event_at(time) for time in self.times)
        first: dict[object, int] = {}
        self._originals = [
            k if self._panel.scan is not None else first.setdefault((event.camera, event.scene_event), k)
            for k, event in enumerate(self.events)
        ]
        self.key = _key(plan, self._panel, self.events, spp)
        self.folder = (cache or cache_folder()) / self.key
        self._images, self._done = self._open()

    def __len__(self) -> int:
        return len(self.events)

    def image(self, k: int) -> Float32:
        """(h, w, 3) float32 linear RGB of image k, which make() has made."""
        first, second = self.halves(k)
        return first if first is second else (first + second) / np.float32(2.0)

    def halves(self, k: int) -> tuple[Float32, Float32]:
        """Image k by two independent halves of its samples; twice the same where it has no noise."""
        images = [half.astype(np.float32) for half in self._images[self.original(k)]]
        return images[0], images[-1]

    def original(self, k: int) -> int:
        """The first image that shows the same as image k: the same camera, and nothing moved since."""
        return self._originals[k]

    def missing(self) -> list[int]:
        """Images still to be made."""
        return [k for k in range(len(self)) if self.original(k) == k and not self._done[k]]

    def make(self, wanted: Iterable[int], progress: Callable[[], None] = lambda: None) -> None:
        """Trace images in this thread; each counts as there only once it is all on disk."""
        spp = self._spp // self._halves
        renderer = OfflineRenderer(self._plan, self._tracer_scene, self.events[0], spp=spp)
        for k in wanted:
            renderer.event = self.events[k]
            for half in range(self._halves):
                tile = Tile(panel=self._panel, seed=SEED + half)
                image = self._rows(renderer, tile, k) if self._panel.scan is not None else self._whole(renderer, tile)
                self._images[k, half] = np.minimum(image, LARGEST)
            self._images.flush()
            self._done[k] = True
            self._done.flush()
            progress()

    def _whole(self, renderer: OfflineRenderer, tile: Tile) -> Float64:
        """(h, w, 3) linear RGB of the renderer's event."""
        return np.concatenate([renderer.band(*band) for band in bands_of(tile)])

    def _rows(self, renderer: OfflineRenderer, tile: Tile, k: int) -> Float64:
        """(h, w, 3) linear RGB of image k, each row (or column, of a display that is mounted turned) of its moment."""
        scan, event, (width, height) = self._panel.scan, self.events[k], self._panel.pixels
        assert scan is not None
        image = np.empty((height, width, 3))
        size, count = ((1, height), width) if scan.per_x else ((width, 1), height)
        for n in range(count):
            x, y = (n, 0) if scan.per_x else (0, n)
            time = self.times[k] + scan.at(x + 0.5, y + 0.5)
            renderer.event = replace(event, camera=self._plan.view.camera_at(time), scene_time=time)
            image[y : y + size[1], x : x + size[0]] = renderer.band(tile, Rect(x=x, y=y, width=size[0], height=size[1]))
        return image

    def _open(self) -> tuple[np.memmap[Any, np.dtype[np.float16]], np.memmap[Any, np.dtype[np.bool_]]]:
        """The files, made whole before they get their name: another process may be at it too."""
        self.folder.mkdir(parents=True, exist_ok=True)
        width, height = self._panel.pixels
        images = _mapped(self.folder / "pictures.npy", np.float16, (len(self), self._halves, height, width, 3))
        return images, _mapped(self.folder / "done.npy", np.bool_, (len(self),))


def cache_folder() -> Path:
    """$XDG_CACHE_HOME/wall/quality, or below ~/.cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wall" / "quality"


def _mapped(path: Path, dtype: type[np.generic], shape: tuple[int, ...]) -> np.memmap[Any, Any]:
    if not path.exists():
        fresh = path.with_name(f"{path.name}.{os.getpid()}")
        np.lib.format.open_memmap(fresh, mode="w+", dtype=dtype, shape=shape).flush()
        try:
            os.link(fresh, path)  # fails where another process was first
        except FileExistsError:
            pass
        finally:
            fresh.unlink()
    return np.lib.format.open_memmap(path, mode="r+")


def _key(plan: Plan, panel: Panel, events: tuple[Event, ...], spp: int) -> str:
    digest = hashlib.blake2b(repr((panel.pixels, spp, SEED)).encode(), digest_size=12)
    scene = plan.scene
    still = (scene.meshes, scene.materials, scene.textures, scene.instances, scene.point_lights)
    _feed(
        digest,
        (still, scene.spot_lights, scene.directional_lights, scene.sky, scene.environment, plan.view.eye, panel.plane),
    )
    if panel.index:  # where it lies in the plane, and the eye that sees it
        _feed(digest, (panel.screen, PanelView(plan.view, panel).eye))
    if scene.occlusion is not None:
        _feed(digest, scene.occlusion)
    if panel.scan is not None:
        _feed(digest, (panel.scan, plan.view.path, [event.scene_time for event in events]))
    for event in dict.fromkeys(events):
        _feed(digest, (event.camera, scene.at(event.scene_time)))
    _feed(digest, [event.number for event in events])
    for source in TRACER_SOURCES:
        path = PACKAGE / source
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.read_bytes())
    return digest.hexdigest()


def _feed(digest: hashlib.blake2b, value: object) -> None:
    """Add a value to a hash: arrays by their bytes, dataclasses and sequences by their parts, the rest by repr."""
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        for field in fields(value):
            _feed(digest, getattr(value, field.name))
    elif isinstance(value, (tuple, list)):
        digest.update(f"[{len(value)}]".encode())
        for part in value:
            _feed(digest, part)
    else:
        digest.update(repr(value).encode())
