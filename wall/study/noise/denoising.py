"""The error of an image at rest before and after `denoise`, by colour alone and with albedos and normals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wall.core.data import Float32, Framelet
from wall.operators.denoise import Denoise
from wall.reconstruction.channels import show_reprojected
from wall.reconstruction.reconstruction import Reconstruction
from wall.sampling.pixel_means import PixelMeans, footprint_of
from wall.study.quality.method import Setup
from wall.study.quality.metrics import display_values, flip, mean_product
from wall.study.quality.reference import Reference
from wall.study.quality.trial import scene_of

REFERENCE_SPP = 1024
REFRESH_S = 1.0 / 60.0  # between two samples of every pixel
CHANNELS = frozenset({"colour", "albedo", "normal"})


@dataclass(frozen=True, slots=True, kw_only=True)
class DenoisedRow:
    """One image of one scene: errors of display values, as root mean square and FLIP."""

    scene: str
    spp: int  # samples a pixel since the camera came to rest
    image: str
    rmse: float
    flip: float


def measure_denoised(
    config: Path, *, size: tuple[int, int], counts: Sequence[int], say: Callable[[str], None]
) -> list[DenoisedRow]:
    """Five rows for each number of samples in `counts`, growing. Raises ConfigError, also where pyoidn is missing."""
    plan, tracer_scene = scene_of(config, size)
    say(f"{config.stem}: reference")
    reference = Reference(plan, tracer_scene, [0.0], spp=REFERENCE_SPP)
    reference.make(reference.missing())
    setup = Setup(plan=plan, tracer_scene=tracer_scene, rate=1.0, refresh_hz=1.0, seed=1)
    event, eye = reference.events[0], plan.view.eye
    tracer, sampler = setup.tracer(coherent=True), PixelMeans(setup.rect, seed=setup.seed)
    tracer.set_event(event)
    images = [Reconstruction(setup.panel, eye, plan.scene, detects_change=False) for _ in range(2)]
    filtered, described = images
    described.describe_surfaces()
    for image in (*images, *images):
        image.refresh(event, 0.0)
    rows = []
    for k in range(counts[-1]):
        samples = tracer.trace(sampler.positions(k), footprint_of(counts[-1]), k)[0]
        for image in images:
            image.insert(samples, (k + 1) * REFRESH_S, event)
            image.refresh(event, (k + 1) * REFRESH_S)
        if k + 1 in counts:
            say(f"{config.stem}: {k + 1} samples a pixel")
            shown = {"filtered": filtered.radiance, **denoised(filtered, setup), **denoised(described, setup)}
            rows += [_row(config.stem, k + 1, name, values, reference) for name, values in shown.items()]
    return rows


def denoised(image: Reconstruction, setup: Setup) -> dict[str, Float32]:
    """What `denoise` is given of an image and what it makes of that, by what it knows; (h, w, 3) float32 linear RGB."""
    operator = Denoise.model_validate({"id": "denoise", "op": "denoise", "input": "image", "quality": "high"})
    prepared = operator.prepare(Path(), [setup.rect])
    source, out = Framelet.blank(setup.rect, CHANNELS), Framelet.blank(setup.rect, frozenset())
    show_reprojected(image, None, np.ones_like(image.buffer.history.dirty), source)
    alone = replace(source, albedo=None, normal=None)
    inputs = {"filtered, denoised": alone}
    if image.surfaces is not None:
        inputs = {"means, denoised by colour": alone, "with albedo and normal": source}
    made = {} if image.surfaces is None else {"means": source.colour}
    for name, known in inputs.items():
        operator.apply([known], out, setup.rect, prepared)
        made[name] = out.colour.copy()
    return made


def _row(scene: str, spp: int, name: str, shown: Float32, reference: Reference) -> DenoisedRow:
    a, *halves = (display_values(image) for image in (shown, *reference.halves(0)))
    square = mean_product(a - halves[0], a - halves[1])
    error = flip(a, display_values(reference.image(0)))
    return DenoisedRow(scene=scene, spp=spp, image=name, rmse=math.sqrt(max(square, 0.0)), flip=error)
