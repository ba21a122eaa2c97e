"""`deep_zoom`: a part of a very large image, of which only the tiles that are looked at are read."""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from annotated_types import Ge, Le
from PIL import Image
from pydantic import Field

from wall.core.colour import srgb_decoded
from wall.core.data import Framelet, Rect
from wall.core.fields import Number, Share, Text
from wall.operators.base import Following, Setting
from wall.operators.pyramid import Codes, Pyramid, TileKey, open_pyramid, size_of
from wall.operators.sources import Source

LEAST_ZOOM, MOST_ZOOM = -8.0, 26.0  # doublings
CACHE_BYTES = 256 << 20  # of tiles in memory,
CACHE_PER_PIXEL = 40  # or so many for each pixel of the area: what it needs takes up to 22, and is always kept
READERS = 2  # threads
RETRY_S = 5.0  # between two tries to read a tile
OPAQUE = np.uint8(255)
MARGIN = 2  # pixels of a level around what is shown: what its filter reads
DECODED = srgb_decoded(np.arange(256, dtype=np.float32) / np.float32(255.0))

Box: TypeAlias = tuple[int, int, int, int]  # left, top, right, bottom


class DeepZoom(Source):
    """A part of a very large image; which part can be changed while the wall runs."""

    op: Literal["deep_zoom"] = Field(description="a part of a very large image")
    file: Text = Field(description="a Deep Zoom Image (.dzi), see wall tiles; or a PNG, JPEG or TIFF, read whole")
    x: Share = Field(default=0.5, description="what is shown in the middle: share of the image's width")
    y: Share = Field(default=0.5, description="the same of its height, from the top")
    zoom: Annotated[Number, Ge(LEAST_ZOOM), Le(MOST_ZOOM)] = Field(
        default=0.0, description="doublings: 0: the whole image fits into the area; 1: twice as large; 3: 8 times"
    )

    SETTINGS: ClassVar[tuple[Setting, ...]] = (
        Setting("x", 0.0, 1.0, "of the width"), Setting("y", 0.0, 1.0, "of the height"),
        Setting("zoom", LEAST_ZOOM, MOST_ZOOM, "doublings"),
    )  # fmt: skip

    def fit(self, folder: Path) -> tuple[float, float]:
        """Width and height of the whole image in pixels of the area, at zoom 0. Raises ConfigError."""
        rect, (width, height) = self.rect([]), size_of(folder / self.file)
        scale = min(rect.width / width, rect.height / height)
        return scale * width, scale * height

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> ZoomedImage:
        """Raises ConfigError: the file cannot be read."""
        rect = self.rect([])
        return ZoomedImage(open_pyramid(folder / self.file), (rect.width, rect.height), (self.x, self.y, self.zoom))

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: ZoomedImage) -> None:
        """Write the pixels of a region."""
        codes = prepared.codes()[region.inside(out.rect)]
        alpha = codes[..., 3].astype(np.float32) / np.float32(255.0)
        self._fill(out, region, DECODED[codes[..., :3]] * alpha[..., None], alpha, None)


@dataclass(frozen=True, slots=True)
class Place:
    """Where an area of pixels lies on a level of a pyramid."""

    level: int
    scale: float  # pixels of the area over those of the level
    left: float  # of the area, pixels of the level
    top: float


class ZoomedImage(Following):
    """The pixels of an area that looks at a pyramid; tiles that are missing are read by threads of its own.

    Until they are there the pixels are made of coarser ones, which are read first.
    """

    def __init__(self, pyramid: Pyramid, size: tuple[int, int], looks_at: tuple[float, float, float]) -> None:
        """`size`: width and height of the area; `looks_at`: x, y, zoom as of DeepZoom."""
        self._pyramid, self._size, self._configured = pyramid, size, looks_at
        self._looks_at, self._codes = looks_at, np.zeros((size[1], size[0], 4), np.uint8)
        self._most_bytes = max(CACHE_BYTES, CACHE_PER_PIXEL * size[0] * size[1])
        self._lock = threading.Lock()  # of all that follows
        self._stale = True  # tiles came, or it looks elsewhere, since the pixels were made
        self._tiles: OrderedDict[TileKey, Codes] = OrderedDict()  # those used last at the end
        self._bytes = 0  # of these
        self._needed: set[TileKey] = set()  # what the pixels are made of, or would be
        self._pending: set[TileKey] = set()  # being read, or waiting for that
        self._failed: dict[TileKey, tuple[float, str]] = {}  # when, and why
        self._readers: ThreadPoolExecutor | None = None

    def follow(self, values: Mapping[str, float]) -> bool:
        """See Following."""
        x, y, zoom = (values.get(name, own) for name, own in zip(("x", "y", "zoom"), self._configured, strict=True))
        with self._lock:
            if (x, y, zoom) != self._looks_at:
                self._looks_at, self._stale = (x, y, zoom), True
            return self._stale

    @property
    def waits(self) -> bool:
        """Whether tiles are missing that will come, or have come and are not shown yet."""
        with self._lock:
            return bool(self._pending) or self._stale

    @property
    def failures(self) -> tuple[str, ...]:
        """Why tiles could not be read; coarser ones stay in their place until they can."""
        with self._lock:
            return tuple(why for _, why in self._failed.values())

    def close(self) -> None:
        """See Following."""
        with self._lock:
            readers, self._readers = self._readers, None
            self._pending.clear()
        if readers is not None:
            readers.shutdown(wait=False, cancel_futures=True)

    def codes(self) -> Codes:
        """(h, w, 4) uint8 of the whole area, sRGB and alpha: 0 beyond the image."""
        with self._lock:
            stale, self._stale = self._stale, False  # first: what comes while pixels are made is for the next
            looks_at = self._looks_at
            if stale:
                self._needed = set()
        if stale:
            self._codes = self._made(self._place(*looks_at))
            with self._lock:
                self._forget()
        return self._codes

    def _place(self, x: float, y: float, zoom: float) -> Place:
        """The finest level whose pixels are no smaller than half of the area's, or the image itself."""
        shape, (width, height) = self._pyramid.shape, self._size
        scale = 2.0**zoom * min(width / shape.width, height / shape.height)
        level = min(max(shape.top + math.ceil(math.log2(scale)), 0), shape.top)
        own, part = scale * 2.0 ** (shape.top - level), 2.0 ** (level - shape.top)
        left, top = x * shape.width * part - 0.5 * width / own, y * shape.height * part - 0.5 * height / own
        return Place(level, own, left, top)

    def _made(self, place: Place) -> Codes:
        width, height = self._size
        out: Codes = np.zeros((height, width, 4), np.uint8)
        level_width, level_height = self._pyramid.shape.size(place.level)
        # pixels of the area whose middle shows the image
        left = max(math.ceil(-place.left * place.scale - 0.5), 0)
        top = max(math.ceil(-place.top * place.scale - 0.5), 0)
        right = min(math.floor((level_width - place.left) * place.scale + 0.5), width)
        bottom = min(math.floor((level_height - place.top) * place.scale + 0.5), height)
        if left >= right or top >= bottom:
            return out
        seen = (
            place.left + left / place.scale, place.top + top / place.scale,
            place.left + right / place.scale, place.top + bottom / place.scale,
        )  # fmt: skip
        margin = MARGIN * max(1.0, 1.0 / place.scale)
        box = (
            max(math.floor(seen[0] - margin), 0), max(math.floor(seen[1] - margin), 0),
            min(math.ceil(seen[2] + margin), level_width), min(math.ceil(seen[3] + margin), level_height),
        )  # fmt: skip
        # pixels at the edge of the image reach half beyond it
        codes = np.pad(self._level(place.level, box), ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), mode="edge")
        opaque = bool((codes[..., 3] == OPAQUE).all())  # else Pillow multiplies by alpha, and rounds
        image = Image.fromarray(codes[..., :3] if opaque else codes)
        x, y = box[0] - MARGIN, box[1] - MARGIN
        inside = (  # an image of a few pixels, much smaller than one of the area's, has no more
            max(seen[0] - x, 0.0), max(seen[1] - y, 0.0),
            min(seen[2] - x, float(image.width)), min(seen[3] - y, float(image.height)),
        )  # fmt: skip
        resample = Image.Resampling.BILINEAR if place.scale <= 1.0 else Image.Resampling.BICUBIC
        shown = np.asarray(image.resize((right - left, bottom - top), resample, box=inside))
        out[top:bottom, left:right, : shown.shape[2]] = shown
        out[top:bottom, left:right, 3] = OPAQUE if opaque else shown[..., 3]
        return out

    def _level(self, level: int, box: Box) -> Codes:
        """(h, w, 4) of a box of a level: of its tiles, and of coarser ones where these are not there yet."""
        edge, middle = self._pyramid.shape.tile, ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)
        keys = list(self._pyramid.shape.tiles(level, box))
        there = self._known(keys)
        out: Codes = np.zeros((box[3] - box[1], box[2] - box[0], 4), np.uint8)
        if len(there) < len(keys):
            if level > 0:
                out[:] = self._coarser(level, box)  # whose tiles are read first
            missing = [key for key in keys if key not in there]
            missing.sort(key=lambda k: math.hypot((k[1] + 0.5) * edge - middle[0], (k[2] + 0.5) * edge - middle[1]))
            self._want(missing)
        for (_, column, row), codes in there.items():
            x, y = column * edge - box[0], row * edge - box[1]
            inside = np.s_[max(y, 0) : max(y + codes.shape[0], 0), max(x, 0) : max(x + codes.shape[1], 0)]
            part = codes[max(-y, 0) :, max(-x, 0) :]
            target = out[inside]
            target[:] = part[: target.shape[0], : target.shape[1]]
        return out

    def _coarser(self, level: int, box: Box) -> Codes:
        """What the next coarser level shows of a box."""
        width, height = self._pyramid.shape.size(level - 1)
        half = box[0] // 2, box[1] // 2, min(-(-box[2] // 2), width), min(-(-box[3] // 2), height)
        twice = self._level(level - 1, half).repeat(2, axis=0).repeat(2, axis=1)
        x, y = box[0] - 2 * half[0], box[1] - 2 * half[1]
        return twice[y : y + box[3] - box[1], x : x + box[2] - box[0]]

    def _known(self, keys: Sequence[TileKey]) -> dict[TileKey, Codes]:
        """Those tiles that are in memory; all are needed from now on."""
        if self._pyramid.at_once:
            return {key: self._pyramid.tile(key) for key in keys}
        with self._lock:
            self._needed.update(keys)
            there = {key: self._tiles[key] for key in keys if key in self._tiles}
            for key in there:
                self._tiles.move_to_end(key)
            return there

    def _want(self, keys: Sequence[TileKey]) -> None:
        """Let tiles be read, one after the other; those that failed are tried again after a while."""
        with self._lock:
            late = {key for key in keys if key in self._tiles}  # they came since they were looked for
            self._stale |= bool(late)
            again = time.monotonic() - RETRY_S
            tried = {key for key in keys if key in self._failed and self._failed[key][0] > again}
            new = [key for key in keys if key not in late | tried | self._pending]
            self._pending.update(new)
            if new and self._readers is None:
                self._readers = ThreadPoolExecutor(READERS, thread_name_prefix="tiles")
            for key in new:
                assert self._readers is not None
                self._readers.submit(self._read, key)

    def _read(self, key: TileKey) -> None:
        with self._lock:
            if key not in self._needed:  # it was passed by meanwhile
                self._pending.discard(key)
                return
        codes, why = None, ""
        try:
            codes = self._pyramid.tile(key)
        except Exception as error:  # of a broken file, or for want of memory: the others are shown all the same
            why = str(error) or type(error).__name__
        with self._lock:
            if codes is None:
                self._failed[key] = time.monotonic(), why
            else:
                self._failed.pop(key, None)
                self._keep(key, codes)
                self._stale = True
            self._pending.discard(key)

    def _keep(self, key: TileKey, codes: Codes) -> None:
        """Keep a tile."""
        before = self._tiles.pop(key, None)
        self._bytes += codes.nbytes - (0 if before is None else before.nbytes)
        self._tiles[key] = codes
        self._forget()

    def _forget(self) -> None:
        """Forget those that were used last the longest ago where there are too many, but none that is needed."""
        for old in list(self._tiles):
            if self._bytes <= self._most_bytes:
                return
            if old not in self._needed:
                self._bytes -= self._tiles.pop(old).nbytes
