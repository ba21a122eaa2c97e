"""The adaptive renderer's own image, sent as an image: what its samples must beat on the wire.

The rank reconstructs, and at every refresh sends its 8-bit image; the display decodes and shows it at once, as
`adaptive` shows its own: no method here is a refresh late. An image equal to the one before is not sent, by whatever
stream. The first image is free, as everybody's. Encoding and decoding are in the CPU time, and the harness's way back
from 8 bits to light; samples are not packed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec

import numpy as np

from wall.core.colour import srgb_decoded
from wall.core.data import Float32
from wall.core.errors import RunError
from wall.reconstruction.display_values import update_display
from wall.study.quality.method import Method, Setup
from wall.study.quality.methods_adaptive import AdaptiveMethod
from wall.study.quality.streams import H264, Bytes, Jpeg, Raw, Stream, Tiles, jpeg_tiles, zstd_tiles

JPEG_QUALITY = 90
H264_PRESET = "veryfast"
H264_METHODS = {  # x264's rate factor and colour
    "stream_h264": (18, "yuv420p"),  # what hardware decodes, said to look lossless
    "stream_h264_fine": (8, "yuv444p"),  # loses no more than the image lacks already
}
NO_H264 = "needs PyAV, which is not installed: pip install -e '.[measure]' in the clone"


class StreamMethod:
    """The adaptive method behind a stream."""

    def __init__(self, setup: Setup, stream: Stream) -> None:
        width, height = setup.size
        self._method, self._stream = AdaptiveMethod(setup, sends=False), stream
        self._everywhere = np.ones((1, 1), np.bool_)
        self._edge = max(width, height)
        self._codes: Bytes = np.zeros((height, width, 3), np.uint8)
        self._sent: Bytes | None = None
        self._shown = np.zeros((height, width, 3), np.float32)
        self.rays = self.secondary = self.bytes = 0

    def advance(self, until: float, rays: int | None = None) -> None:
        """See Method."""
        self._method.advance(until, rays)
        self.rays, self.secondary = self._method.rays, self._method.secondary

    def show(self, time: float) -> Float32:
        """Returns the method's image at `time` as the receiver decodes it, (h, w, 3) linear RGB."""
        update_display(self._method.show(time), self._everywhere, self._edge, self._codes)
        if self._sent is None or not np.array_equal(self._sent, self._codes):
            message = self._stream.encode(self._codes)
            self.bytes += len(message) if self._sent is not None else 0
            self._sent = self._codes.copy()
            self._shown = light_of_codes()[self._stream.decode(message)]
        return self._shown


def absent() -> dict[str, str]:
    """Methods that cannot run here, and why not."""
    return {} if find_spec("av") else dict.fromkeys(H264_METHODS, NO_H264)


@cache
def light_of_codes() -> Float32:
    """(256,) linear light of 8-bit sRGB codes."""
    return srgb_decoded(np.arange(256, dtype=np.float32) / np.float32(255))


def raw(setup: Setup) -> StreamMethod:
    """Returns the stream of uncompressed images."""
    return StreamMethod(setup, Raw(setup.size))


def lossless(setup: Setup) -> StreamMethod:
    """Returns the stream of changed tiles, compressed by zstd."""
    return StreamMethod(setup, Tiles(setup.size, zstd_tiles()))


def jpeg(setup: Setup) -> StreamMethod:
    """Returns the stream of whole JPEG images."""
    return StreamMethod(setup, Jpeg(JPEG_QUALITY))


def dirty_jpeg(setup: Setup) -> StreamMethod:
    """Returns the stream of changed tiles as JPEG."""
    return StreamMethod(setup, Tiles(setup.size, jpeg_tiles(JPEG_QUALITY)))


def h264(name: str, setup: Setup) -> StreamMethod:
    """Raises RunError without PyAV."""
    if name in absent():
        raise RunError(f"{name} {absent()[name]}")
    crf, pixels = H264_METHODS[name]
    made = H264(setup.size, crf=crf, pixels=pixels, preset=H264_PRESET, refresh_hz=setup.refresh_hz)
    return StreamMethod(setup, made)


METHODS: dict[str, Callable[[Setup], Method]] = {
    "stream_raw": raw,
    "stream_zstd_tiles": lossless,
    "stream_jpeg90": jpeg,
    "stream_jpeg90_tiles": dirty_jpeg,
    **{name: partial(h264, name) for name in H264_METHODS},
}
