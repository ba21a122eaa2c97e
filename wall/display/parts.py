"""What a viewer of the page holds of a panel, and what it gets next: tiles of its image, or samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.display.base import PanelImage
from wall.display.sample_store import SampleStore
from wall.display.stream import encode_samples, encode_tiles, panel_message, samples_message
from wall.display.tiles import changed_since

REST_S = 0.5  # a panel that has not changed for so long is sent without losses,
TILES_AT_REST = 64  # so many tiles at a time: 6 ms to encode, soon over if something moves again
MOSTLY = 0.8  # of a panel: when more has changed, all of it is as cheap


@dataclass(slots=True)
class Held:
    """What a viewer holds of a panel."""

    version: int | None = None  # None: nothing
    samples: bool = False  # whether it holds samples, and the version is of a SampleStore
    lossy: NDArray[np.bool_] | None = None  # (rows, columns): the tiles that it has as JPEG
    sent_at: float = 0.0  # when the version was sent, seconds of the loop


@dataclass(frozen=True, slots=True)
class TilesPart:
    """Tiles of a panel to be sent, and how."""

    panel: PanelImage
    tiles: NDArray[np.bool_]  # (rows, columns)
    exactly: bool

    @property
    def key(self) -> tuple[object, ...]:
        """Equal keys encode to equal bytes."""
        return self.panel.version, self.exactly, np.packbits(self.tiles).tobytes()

    def encode(self) -> tuple[int, bytes]:
        """The version that is encoded, and the bytes."""
        return self.panel.version, encode_tiles(self.panel, self.tiles, exactly=self.exactly)

    def message(self, index: int, *, compared: bool, encoded: bytes, version: int, number: int) -> bytes:
        """The bytes as a message of image `number`."""
        return panel_message(index, self.panel, self.tiles, encoded=encoded, number=number, compared=compared)

    def sent(self, held: Held, version: int, now: float) -> None:
        """Note in `held` that the viewer has it."""
        if held.lossy is None:
            held.lossy = self.tiles
        else:
            held.lossy = held.lossy & ~self.tiles if self.exactly else held.lossy | self.tiles
        if not self.exactly:
            held.version, held.sent_at = version, now


@dataclass(frozen=True, slots=True)
class SamplesPart:
    """The samples of a panel that came after a version, to be sent."""

    panel: PanelImage
    store: SampleStore
    since: int | None  # None: all

    @property
    def key(self) -> tuple[object, ...]:
        """Equal keys encode to equal bytes, or to newer ones."""
        return self.store.version, self.since

    def encode(self) -> tuple[int, bytes]:
        """The version up to which samples are encoded, and the bytes."""
        version, samples = self.store.since(self.since)
        return version, encode_samples(samples, whole=self.since is None)

    def message(self, index: int, *, compared: bool, encoded: bytes, version: int, number: int) -> bytes:
        """The bytes as a message of image `number`."""
        return samples_message(index, self.panel.rgb.shape[:2], encoded=encoded, version=version, number=number)

    def sent(self, held: Held, version: int, now: float) -> None:
        """Note in `held` that the viewer has them."""
        held.version, held.sent_at = version, now


Part = TilesPart | SamplesPart


def part_of(held: Held, panel: PanelImage, store: SampleStore | None, now: float) -> Part | None:
    """What a viewer needs next of a panel: samples that it lacks, or tiles where there is no store of them.

    Of tiles what changed, or when the panel rests, some of what it has with losses.
    """
    if held.samples != (store is not None):
        held.version, held.lossy, held.samples = None, None, store is not None
    if store is not None:
        return SamplesPart(panel, store, held.version) if held.version != store.version else None
    if held.version != panel.version:
        tiles = changed_since(panel, held.version)
        return TilesPart(panel, np.ones_like(tiles) if tiles.mean() > MOSTLY else tiles, exactly=False)
    if held.lossy is None or not held.lossy.any() or now < held.sent_at + REST_S:
        return None
    first = held.lossy & (np.cumsum(held.lossy).reshape(held.lossy.shape) <= TILES_AT_REST)
    return TilesPart(panel, first, exactly=True)
