"""An image and the adaptive sampler that chooses by it, as at a renderer that makes the image which is shown.

Its resolution, and how many samples it keeps, follow what gets done: at equal CPU time a method that is late makes its
image of fewer pixels, and of fewer samples, as a running wall does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

from wall.core.data import Event, Float32, Samples
from wall.reconstruction.dynamic_resolution import DynamicResolution
from wall.reconstruction.reconstruction import ALL, Ingredients, Reconstruction
from wall.roles.image_sampler import ImageSampler
from wall.roles.resolution import ResolutionChoice, first_scale
from wall.roles.sample_budget import SampleBudget
from wall.roles.view import NEWEST_SHARE
from wall.sampling.adaptive import AdaptiveSampler
from wall.sampling.base import Targets
from wall.scene.needs import needs
from wall.study.quality.method import Setup

BATCH = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """How the image is made and its samples are chosen, to measure what each part is worth."""

    tiling: Literal["grid", "cut"] = "grid"
    uniform: bool = False  # every pixel gains the same
    ingredients: Ingredients = ALL
    full: bool = False  # always of all pixels and samples; so where an ingredient is left out


class SampledImage:
    """Of the only panel. `choose` rays, `insert` their samples, `refresh`; `radiance` is the image."""

    def __init__(self, setup: Setup, variant: Variant) -> None:
        eye, scene, panel = setup.plan.view.eye, setup.plan.scene, setup.panel
        changes = needs(scene).change_detection
        self._image: Reconstruction | DynamicResolution
        if variant.full or variant.ingredients != ALL:
            self._image = Reconstruction(panel, eye, scene, detects_change=changes, ingredients=variant.ingredients)
        else:
            self._image = DynamicResolution(panel, eye, scene, detects_change=changes, scale=first_scale(panel))
        make = partial(AdaptiveSampler, batch=BATCH, seed=setup.seed, tiling=variant.tiling, uniform=variant.uniform)
        self._sampler = ImageSampler(self._image, make)
        self._resolution, self._budget = ResolutionChoice(panel), SampleBudget()
        self._period = self._interval = 1.0 / setup.refresh_hz  # between refreshes: wanted, and a moving mean
        self._shown: tuple[float, Event] | None = None  # the last refresh

    @property
    def radiance(self) -> Float32:
        """(h, w, 3) float32 linear RGB of the panel."""
        return self._image.radiance

    def choose(self, event: Event, rays: int) -> Targets | None:
        """The next rays, on the panel; None where no pixel gains."""
        return self._sampler.choose(event, rays)

    def insert(self, samples: Samples, now: float, event: Event) -> None:
        """Store samples of the panel; their `change` is written."""
        self._sampler.insert(samples, now, event)
        if self._shown is not None:  # the first image is not paid for
            self._resolution.note(len(samples))

    def refresh(self, event: Event, now: float) -> None:
        """Show the samples under `event`, and score every pixel anew."""
        image, before = self._image, self._shown
        if isinstance(image, DynamicResolution) and before is not None:
            self._interval += NEWEST_SHARE * (now - before[0] - self._interval)
            image.keep(self._budget.after(self._interval / self._period - 1.0))
        image.refresh(event, now)
        if isinstance(image, DynamicResolution):
            still = before is not None and before[1].camera == event.camera
            image.rescale(self._resolution.after(now, still=still, stored=image.count))
        self._shown = now, event
        self._sampler.replan()
