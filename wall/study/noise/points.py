"""The error of N samples a pixel by the random numbers that paths have, and by independent ones.

Errors need no reference: two images of equally many samples and different seeds differ by sqrt(2) times the error of
either, since both have the same mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from wall.core.data import Float64
from wall.sampling.pixel_means import PixelMeans
from wall.study.quality.method import Inputs, Setup, centres
from wall.study.quality.trial import scene_of

SEEDS = (1, 2)
INDEPENDENT = 0x9E3779B1  # odd: times the number of a sample, its seed


@dataclass(frozen=True, slots=True, kw_only=True)
class PointsRow:
    """One scene at one number of samples a pixel; errors are root mean squares of linear RGB."""

    scene: str
    spp: int
    ours: float
    independent: float
    blurred: float  # `ours` after a Gaussian of sigma 1.5 pixels
    blurred_independent: float

    @property
    def equals(self) -> float:
        """How many independent samples give our error: theirs falls as 1 / sqrt(N)."""
        return self.spp * (self.independent / self.ours) ** 2 if self.ours > 0.0 else math.inf


def measure_points(
    config: Path, *, size: tuple[int, int], counts: Sequence[int], say: Callable[[str], None]
) -> list[PointsRow]:
    """A row for each number of samples in `counts`, growing. Raises ConfigError."""
    plan, tracer_scene = scene_of(config, size)
    setup = Setup(plan=plan, tracer_scene=tracer_scene, rate=1.0, refresh_hz=1.0, seed=0)
    images = [means(setup, counts, seed, independent=way) for way in (False, True) for seed in SEEDS]
    rows = []
    for spp in counts:
        say(f"{config.stem}: {spp} samples a pixel")
        a, b, c, d = (next(image) for image in images)
        rows.append(
            PointsRow(
                scene=config.stem, spp=spp, ours=error_of(a, b), independent=error_of(c, d),
                blurred=error_of(blurred(a), blurred(b)), blurred_independent=error_of(blurred(c), blurred(d)),
            )
        )  # fmt: skip
    return rows


def means(setup: Setup, counts: Sequence[int], seed: int, *, independent: bool) -> Iterator[Float64]:
    """(h, w, 3) float64 linear RGB, means of the first so many samples of each pixel at time 0.

    independent : each sample takes the first random numbers of a seed of its own, so those of a pixel's samples have
        nothing in common

    All samples lie in the middle of their pixels: edges between them are not what is measured.
    """
    tracer, sampler = setup.tracer(coherent=True), PixelMeans(setup.rect, seed=seed)
    tracer.set_event(Inputs(setup.plan).event_at(0.0))
    xy, last = centres(setup), 0
    for spp in counts:
        for k in range(last, spp):
            tracer.seed = (seed + INDEPENDENT * (k + 1)) & 0xFFFFFFFF if independent else seed
            sampler.add(tracer.trace(xy, number=0 if independent else k)[0])
        last = spp
        yield sampler.mean()


def error_of(first: Float64, second: Float64) -> float:
    """The root mean square error of either of two images of independent noise and the same mean."""
    return math.sqrt(float(((first - second) ** 2).mean()) / 2.0)


def blurred(image: Float64) -> Float64:
    """The image after a Gaussian of sigma 1.5 pixels, which stands for an eye that does not resolve pixels."""
    from scipy.ndimage import gaussian_filter

    found: Float64 = gaussian_filter(image, (1.5, 1.5, 0.0), mode="reflect")
    return found
