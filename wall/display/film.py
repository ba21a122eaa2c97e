"""Films in H.264. They need PyAV, which an extra brings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wall.core.errors import ConfigError
from wall.display.files import check_target, replaced

Bytes = NDArray[np.uint8]  # (h, w, 3) sRGB

QUALITY = 14  # x264's constant rate factor: errors that one has to look for
SUFFIXES = (".mp4",)


def check_film(path: Path, option: str) -> None:
    """Refuse a film that cannot be written, before anything is rendered for it. Raises ConfigError."""
    check_target(path, SUFFIXES, option=option)
    if find_spec("av") is None:
        raise ConfigError(f"{option} {path}: needs PyAV; wanted: pip install 'wall[film]'")


def write_film(path: Path, images: Iterable[Bytes], *, hz: float | Fraction, quality: int = QUALITY) -> None:
    """Encode (h, w, 3) uint8 RGB images of one size. Raises RunError where the file cannot be written."""
    import av

    rate = Fraction(hz).limit_denominator(1001)
    with replaced(path) as part, av.open(str(part), "w", format="mp4", options={"movflags": "+faststart"}) as film:
        stream = None
        for image in images:
            even = _even(image)
            if stream is None:
                stream = film.add_stream("libx264", rate=rate, options={"crf": str(quality), "preset": "veryfast"})
                stream.height, stream.width = even.shape[:2]
                stream.pix_fmt = "yuv420p"
            film.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")))
        if stream is not None:
            film.mux(stream.encode())


def read_film(path: Path) -> Iterator[Bytes]:
    """The images of a film."""
    import av

    with av.open(str(path)) as film:
        for frame in film.decode(video=0):
            yield np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


def _even(image: Bytes) -> Bytes:
    """Padded to even sizes: colour has half the resolution."""
    height, width = image.shape[:2]
    return np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
