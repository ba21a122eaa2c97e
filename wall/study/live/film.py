"""Films in H.264: what one run showed, in real time; and those of several methods side by side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from math import ceil, sqrt
from pathlib import Path

import numpy as np
from PIL import Image

from wall.display.files import replaced
from wall.study.live.images import PAPER, beside, labelled
from wall.study.quality.image_strips import GAP, Bytes

OWN_QUALITY, QUALITY = 14, 20  # x264's constant rate factor, of a run's own film and of that of all methods
OWN_WIDTH, WIDTH = 960, 1920  # pixels at most
SLOWEST_HZ, FASTEST_HZ = 24.0, 60.0


def write_film(path: Path, images: Iterable[Bytes], *, hz: float, quality: int = OWN_QUALITY) -> None:
    """Encode (h, w, 3) uint8 RGB images of one size. Raises RunError where the file cannot be written."""
    import av

    rate = Fraction(hz).limit_denominator(1000)
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


def hz_of(path: Path) -> float:
    """Images a second of a film."""
    import av

    with av.open(str(path)) as film:
        return float(film.streams.video[0].average_rate or SLOWEST_HZ)


def film_hz(refresh_hz: float) -> float:
    """Images a second of the film of a wall."""
    return min(max(refresh_hz, SLOWEST_HZ), FASTEST_HZ)


def scaled(image: Bytes, width: int) -> Bytes:
    """The image, smaller if it is wider than `width`, pixels repeated if it is less than half as wide."""
    if image.shape[1] <= width:
        times = width // image.shape[1]
        return image.repeat(times, axis=0).repeat(times, axis=1)
    size = (width, max(1, round(image.shape[0] * width / image.shape[1])))
    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BOX))


def side_by_side(films: Mapping[str, Path]) -> Iterator[Bytes]:
    """Images of several films together, as long as all go on; each below its text, in about as many columns as rows."""
    columns = ceil(sqrt(len(films))) if len(films) > 2 else len(films)
    width = (WIDTH - GAP * (columns - 1)) // columns
    for images in zip(*(read_film(path) for path in films.values()), strict=False):
        cells = [labelled(scaled(image, width), text) for text, image in zip(films, images, strict=True)]
        cells += [np.full_like(cells[0], PAPER[0]) for _ in range(-len(cells) % columns)]
        rows = [beside(cells[k : k + columns]) for k in range(0, len(cells), columns)]
        yield np.concatenate(rows)


def _even(image: Bytes) -> Bytes:
    """Padded to even sizes: colour has half the resolution."""
    height, width = image.shape[:2]
    return np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
