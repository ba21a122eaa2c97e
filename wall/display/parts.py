"""What a viewer of the page holds of a panel, and what it gets next: tiles of its image, or samples.

Tiles are sent when they differ visibly from what was sent last: by more than INVISIBLE codes. JPEG may be off by more.
Smaller differences wait until the tile rests. Then it is sent without losses, if that is not what the viewer has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.display.base import PanelImage
from wall.display.cheapest import exact_tiles
from wall.display.kernels.tiles import take_visible
from wall.display.sample_store import SampleStore
from wall.display.stream import encode_samples, encode_tiles, panel_message, samples_message
from wall.display.tiles import TILE, changed_since

INVISIBLE = 2  # 8-bit codes that a value may be off by until its tile rests
REST_S = 0.5  # tiles that have not changed for so long are sent without losses,
LONG_REST_S = 4.0  # or for so long, where others of their panel change visibly
TILES_AT_REST = 64  # so many tiles at a time: 6 ms to encode, soon over if something moves again
MOSTLY = 0.8  # of a panel: when more has changed, all of it is as cheap


class PanelChanges:
    """When the tiles of a panel changed, for all viewers of it. Used by one thread."""

    def __init__(self) -> None:
        self.number = 0  # of images followed
        self._newest: PanelImage | None = None
        self._shown = np.zeros((0, 0, 3), np.uint8)  # each tile as it last differed visibly
        self.changed = np.zeros((0, 0), np.int64)  # (rows, columns) number of the image in which a tile last changed
        self.visible = np.zeros((0, 0), np.int64)  # (rows, columns) in which it last differed visibly from before
        self._changed_at = np.zeros((0, 0))  # (rows, columns) seconds, of `changed`
        self._moved_at = 0.0  # of the newest of `visible`

    def follow(self, panel: PanelImage, now: float) -> PanelImage:
        """Note what has changed in an image, at `now` seconds. Returns it, or a newer one that was followed before."""
        if self._newest is not None and panel.version <= self._newest.version:
            return self._newest
        changed = changed_since(panel, None if self._newest is None else self._newest.version)
        visible = changed.copy()
        if self._shown.shape == panel.rgb.shape:
            take_visible(self._shown, panel.rgb, TILE, np.uint8(INVISIBLE), visible)
        else:
            changed[:] = visible[:] = True
            self._shown = panel.rgb.copy()
            self.changed, self.visible = np.zeros(changed.shape, np.int64), np.zeros(changed.shape, np.int64)
            self._changed_at = np.zeros(changed.shape)
        self.number, self._newest = self.number + 1, panel
        self.changed[changed], self.visible[visible], self._changed_at[changed] = self.number, self.number, now
        self._moved_at = now if visible.any() else self._moved_at
        return panel

    def resting(self, now: float) -> NDArray[np.bool_]:
        """(rows, columns) bool: the tiles that rest at `now` seconds."""
        return np.asarray(self._changed_at <= now - (REST_S if now >= self._moved_at + REST_S else LONG_REST_S))


@dataclass(slots=True)
class Held:
    """What a viewer holds of a panel."""

    version: int | None = None  # the newest that it has what it needs of; None: nothing
    samples: bool = False  # whether it holds samples, and the version is of a SampleStore
    tiles: NDArray[np.int64] | None = None  # (rows, columns): PanelChanges.number of each when it was sent
    lossy: NDArray[np.bool_] | None = None  # (rows, columns): those that it has as JPEG
    complete: bool = False  # it has every pixel of the version

    def is_current(self, panel: PanelImage, store: SampleStore | None) -> bool:
        """Whether it needs nothing of the newest image, or of the newest samples."""
        if self.samples != (store is not None):
            return False
        return self.version == store.version if store is not None else self.complete and self.version == panel.version


@dataclass(frozen=True, slots=True)
class Piece:
    """What one message brings of a panel."""

    encoded: bytes
    tiles: NDArray[np.bool_] | None = None  # (rows, columns); None: samples
    exactly: bool = False


@dataclass(frozen=True, slots=True)
class TilesPart:
    """Tiles of a panel to be sent: exactly, or as is cheapest."""

    panel: PanelImage
    tiles: NDArray[np.bool_]  # (rows, columns)
    exactly: bool
    change: int  # PanelChanges.number

    @property
    def key(self) -> tuple[object, ...]:
        """Equal keys encode to equal bytes."""
        return self.panel.version, self.exactly, np.packbits(self.tiles).tobytes()

    def encode(self) -> tuple[int, list[Piece]]:
        """The version that is encoded, and its pieces."""
        exact = self.tiles if self.exactly else exact_tiles(self.panel.rgb, self.tiles)
        ways = ((self.tiles & ~exact, False), (exact, True))
        return self.panel.version, [
            Piece(encode_tiles(self.panel, tiles, exactly=way), tiles, way) for tiles, way in ways if tiles.any()
        ]

    def message(self, index: int, piece: Piece, *, compared: bool, version: int, number: int) -> bytes:
        """A piece as a message of image `number`."""
        assert piece.tiles is not None
        return panel_message(index, self.panel, piece.tiles, encoded=piece.encoded, number=number, compared=compared)

    def sent(self, held: Held, version: int, pieces: list[Piece]) -> None:
        """Note in `held` that the viewer has it."""
        if held.tiles is None or held.lossy is None or held.tiles.shape != self.tiles.shape:
            held.tiles, held.lossy = np.zeros(self.tiles.shape, np.int64), np.zeros(self.tiles.shape, np.bool_)
        held.tiles[self.tiles] = self.change
        for piece in pieces:
            held.lossy[piece.tiles] = not piece.exactly


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

    def encode(self) -> tuple[int, list[Piece]]:
        """The version up to which samples are encoded, and the bytes."""
        version, samples = self.store.since(self.since)
        return version, [Piece(encode_samples(samples, whole=self.since is None))]

    def message(self, index: int, piece: Piece, *, compared: bool, version: int, number: int) -> bytes:
        """The piece as a message of image `number`."""
        return samples_message(index, self.panel.rgb.shape[:2], encoded=piece.encoded, version=version, number=number)

    def sent(self, held: Held, version: int, pieces: list[Piece]) -> None:
        """Note in `held` that the viewer has them."""
        held.version = version


Part = TilesPart | SamplesPart


def parts_of(held: Held, panel: PanelImage, store: SampleStore | None, changes: PanelChanges, now: float) -> list[Part]:
    """What a viewer needs next of a panel: samples that it lacks, or tiles where there is no store of them.

    Of tiles what changed visibly, and some of those that rest if it lacks any of their pixels.
    """
    if held.samples != (store is not None):
        held.version, held.tiles, held.lossy, held.samples = None, None, None, store is not None
    if store is not None:
        return [SamplesPart(panel, store, held.version)] if held.version != store.version else []
    panel = changes.follow(panel, now)
    held.version, held.complete = panel.version, False
    if held.tiles is None or held.lossy is None or held.tiles.shape != changes.visible.shape:
        return [TilesPart(panel, np.ones(changes.visible.shape, np.bool_), exactly=False, change=changes.number)]
    moved = changes.visible > held.tiles
    if moved.mean() > MOSTLY:
        moved[:] = True
    lacking = ~moved & (held.lossy | (changes.changed > held.tiles))
    held.complete = not (moved | lacking).any()
    rests = lacking & changes.resting(now)
    rests &= np.cumsum(rests).reshape(rests.shape) <= TILES_AT_REST
    wanted = ((moved, False), (rests, True))
    return [TilesPart(panel, tiles, exactly=way, change=changes.number) for tiles, way in wanted if tiles.any()]
