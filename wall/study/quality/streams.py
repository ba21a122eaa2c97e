"""Images as messages: what would be sent if a rank made the image, and not the display's side.

A stream is a sender and a receiver that share nothing but messages, in order and without loss: the mildest conditions
for those that build on what was sent before. Images are (h, w, 3) uint8 sRGB.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
import simplejpeg
import zstandard
from numpy.typing import NDArray

from wall.core.errors import RemoteProtocolError

Bytes = NDArray[np.uint8]

TILE = 16  # pixels: a block of 4:2:0 JPEG, so tiles bleed into nothing; 32 and 64 save 3 % of zstd while all moves
ZSTD_LEVEL = 1  # of filtered tiles 3 is larger, by 3 %
MOSAIC_COLUMNS = 64  # tiles side by side in a JPEG of tiles: neither edge of it may exceed 65535 pixels
ENDLESS = 1 << 24  # images between two that stand alone: nothing is lost here, so one is enough


class Stream(Protocol):
    """Codec of a sequence of images of 8-bit RGB."""

    def encode(self, image: Bytes) -> bytes:
        """The sender's side: the message that an image needs after those before it."""
        ...

    def decode(self, message: bytes) -> Bytes:
        """The receiver's side: the image that is shown then."""
        ...


class Raw:
    """Every pixel as it is."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._shape = (size[1], size[0], 3)

    def encode(self, image: Bytes) -> bytes:
        """Returns the image's bytes."""
        return image.tobytes()

    def decode(self, message: bytes) -> Bytes:
        """Returns the image, (h, w, 3) uint8."""
        return np.frombuffer(message, np.uint8).reshape(self._shape)


class Jpeg:
    """Whole images at a libjpeg quality, colour at half resolution as libjpeg does by default."""

    def __init__(self, quality: int) -> None:
        self._quality = quality

    def encode(self, image: Bytes) -> bytes:
        """Returns the image as JPEG, with chroma at half resolution."""
        return bytes(simplejpeg.encode_jpeg(np.ascontiguousarray(image), self._quality, "RGB", "420", False))

    def decode(self, message: bytes) -> Bytes:
        """Returns the image, (h, w, 3) uint8."""
        found: Bytes = simplejpeg.decode_jpeg(message, "RGB")
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class TileCodec:
    """(n, TILE, TILE, 3) uint8, n >= 1, to bytes and back."""

    pack: Callable[[Bytes], bytes]
    unpack: Callable[[bytes, int], Bytes]  # bytes, n


class Tiles:
    """Only tiles that differ from those sent last: a bit for every tile, then all that changed in one piece."""

    def __init__(self, size: tuple[int, int], codec: TileCodec) -> None:
        self._size, self._codec = size, codec
        self._columns, self._rows = -(-size[0] // TILE), -(-size[1] // TILE)
        self._sent: Bytes | None = None  # by the sender, before any loss
        self._shown = np.zeros((self._rows * self._columns, TILE, TILE, 3), np.uint8)  # by the receiver

    def encode(self, image: Bytes) -> bytes:
        """Returns a bit mask of the changed tiles and their pixels; no bytes if none changed."""
        tiles = self._cut(image)
        changed = np.ones(len(tiles), np.bool_)
        if self._sent is not None:
            changed = (tiles != self._sent).any((1, 2, 3))
        self._sent = tiles
        if not changed.any():
            return b""
        return np.packbits(changed).tobytes() + self._codec.pack(tiles[changed])

    def decode(self, message: bytes) -> Bytes:
        """Updates the changed tiles and returns the image, (h, w, 3) uint8."""
        if message:
            mask = -(-len(self._shown) // 8)
            changed = np.unpackbits(np.frombuffer(message, np.uint8, mask), count=len(self._shown)).astype(np.bool_)
            self._shown[changed] = self._codec.unpack(message[mask:], int(changed.sum()))
        rows = self._shown.reshape(self._rows, self._columns, TILE, TILE, 3).swapaxes(1, 2)
        whole: Bytes = rows.reshape(self._rows * TILE, self._columns * TILE, 3)
        return whole[: self._size[1], : self._size[0]]

    def _cut(self, image: Bytes) -> Bytes:
        """Tiles in reading order; those that overhang repeat the image's edge."""
        height, width = image.shape[:2]
        spare = ((0, self._rows * TILE - height), (0, self._columns * TILE - width), (0, 0))
        rows = np.pad(image, spare, mode="edge").reshape(self._rows, TILE, self._columns, TILE, 3)
        return rows.swapaxes(1, 2).reshape(-1, TILE, TILE, 3)


def filtered(tiles: Bytes) -> Bytes:
    """(3, n, TILE, TILE) uint8: red and blue less green, each value less its left neighbour, modulo 256.

    As PNG's filter Sub and JPEG 2000's reversible colours: a fifth off zstd's bytes of rendered images.
    """
    planes = np.moveaxis(tiles, 3, 0).copy()
    planes[0] -= planes[1]
    planes[2] -= planes[1]
    planes[..., 1:] -= planes[..., :-1].copy()
    planes[..., 1:, 0] -= planes[..., :-1, 0].copy()
    return planes


def restored(planes: Bytes) -> Bytes:
    """The inverse of `filtered`: (n, TILE, TILE, 3) uint8."""
    planes = planes.copy()
    planes[..., 0] = np.cumsum(planes[..., 0], axis=-1, dtype=np.uint8)
    planes = np.cumsum(planes, axis=-1, dtype=np.uint8)
    planes[0] += planes[1]
    planes[2] += planes[1]
    return np.moveaxis(planes, 0, 3)


def zstd_tiles() -> TileCodec:
    """Lossless."""
    compressor, expander = zstandard.ZstdCompressor(level=ZSTD_LEVEL), zstandard.ZstdDecompressor()

    def unpack(data: bytes, n: int) -> Bytes:
        planes = np.frombuffer(expander.decompress(data), np.uint8)
        return restored(planes.reshape(3, n, TILE, TILE))

    return TileCodec(pack=lambda tiles: compressor.compress(filtered(tiles).tobytes()), unpack=unpack)


def jpeg_tiles(quality: int) -> TileCodec:
    """A mosaic of the tiles, as one JPEG: a file for each would be mostly headers."""
    jpeg = Jpeg(quality)

    def pack(tiles: Bytes) -> bytes:
        columns = min(len(tiles), MOSAIC_COLUMNS)
        rows = -(-len(tiles) // columns)
        mosaic = np.pad(tiles, ((0, rows * columns - len(tiles)), (0, 0), (0, 0), (0, 0)), mode="edge")
        pixels = mosaic.reshape(rows, columns, TILE, TILE, 3).swapaxes(1, 2)
        return jpeg.encode(pixels.reshape(rows * TILE, columns * TILE, 3))

    def unpack(data: bytes, n: int) -> Bytes:
        pixels = jpeg.decode(data)
        rows, columns = pixels.shape[0] // TILE, pixels.shape[1] // TILE
        return pixels.reshape(rows, TILE, columns, TILE, 3).swapaxes(1, 2).reshape(-1, TILE, TILE, 3)[:n]

    return TileCodec(pack=pack, unpack=unpack)


class H264:
    """x264 without look-ahead or B-frames (tune zerolatency), one thread; the first image is the only key frame."""

    def __init__(self, size: tuple[int, int], *, crf: int, pixels: str, preset: str, refresh_hz: float) -> None:
        """`crf`: x264's constant rate factor, 0 (lossless) to 51; `pixels`: yuv420p or yuv444p."""
        import av

        self._av, self._size, self._count = av, size, 0
        rate = Fraction(refresh_hz).limit_denominator(1000)
        sender = av.CodecContext.create("libx264", "w")
        sender.width, sender.height = (-(-edge // 2) * 2 for edge in size)  # colour at half resolution
        sender.pix_fmt, sender.framerate, sender.time_base = pixels, rate, 1 / rate
        sender.thread_count, sender.gop_size = 1, ENDLESS
        sender.options = {"preset": preset, "tune": "zerolatency", "crf": str(crf), "scenecut": "0"}
        self._sender, self._receiver = sender, av.CodecContext.create("h264", "r")
        self._receiver.thread_count = 1

    def encode(self, image: Bytes) -> bytes:
        """Returns the encoder's packet of the image, padded to even sizes."""
        (width, height), sender = self._size, self._sender
        even = np.pad(image, ((0, sender.height - height), (0, sender.width - width), (0, 0)), mode="edge")
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
        frame.pts, self._count = self._count, self._count + 1
        return b"".join(bytes(packet) for packet in sender.encode(frame))

    def decode(self, message: bytes) -> Bytes:
        """Returns the image of one packet, (h, w, 3) uint8."""
        frames: list[Any] = self._receiver.decode(self._av.Packet(message))
        if len(frames) != 1:
            raise RemoteProtocolError(f"H.264: {len(frames)} images came of one message of {len(message)} bytes")
        found: Bytes = frames[0].to_ndarray(format="rgb24")
        return found[: self._size[1], : self._size[0]]
