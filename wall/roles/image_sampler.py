"""The adaptive sampler of an image that is made at several resolutions: its rays and samples are of the panel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from wall.core.data import Event, Rect, Samples
from wall.deepbuffer.feedback import Feedback
from wall.deepbuffer.pose import Posed
from wall.reconstruction.dynamic_resolution import DynamicResolution
from wall.reconstruction.reconstruction import Reconstruction
from wall.sampling.adaptive import AdaptiveSampler
from wall.sampling.base import Targets


class ImageSampler:
    """Of one image. `choose` rays, `insert` their samples, `replan` after a refresh."""

    def __init__(
        self, image: Reconstruction | DynamicResolution, make: Callable[[Rect, Feedback], AdaptiveSampler]
    ) -> None:
        """`make`: a sampler of these pixels, one for each resolution."""
        self._image, self._make = image, make
        self._samplers: dict[Rect, AdaptiveSampler] = {}
        self._planned = self.current

    @property
    def current(self) -> AdaptiveSampler:
        """The sampler of the pixels that the image is made of now."""
        image = self._image
        rect = image.current.rect if isinstance(image, DynamicResolution) else image.rect
        if rect not in self._samplers:
            self._samplers[rect] = self._make(rect, image.feedback())
        return self._samplers[rect]

    @property
    def rescaled(self) -> bool:
        """Whether the image has another resolution than when its pixels were scored."""
        return self.current is not self._planned

    def replan(self) -> None:
        """Score every pixel anew."""
        self._planned = self.current
        self._planned.replan(self._image.feedback())

    def choose(self, event: Event, rays: int | None = None) -> Targets | None:
        """The next rays, see AdaptiveSampler."""
        targets, image = self.current.choose(event, rays), self._image
        if targets is None or not isinstance(image, DynamicResolution):
            return targets
        return replace(targets, xy=image.to_panel(targets.xy), footprint=image.scale * targets.footprint)

    def insert(self, samples: Samples, base_time: float, event: Posed, *, chosen: bool = True) -> None:
        """Store samples in the image; their `change` is written. `chosen`: by this sampler, which learns from them."""
        own = self._in_image(samples)
        self._image.insert(own, base_time, event)
        if chosen:
            self.current.observe(own)
        samples["change"] = own["change"]

    def forget(self, samples: Samples, base_time: float) -> None:
        """Take samples back, so that their pixels are sampled again."""
        own = self._in_image(samples)
        self._image.forget(own, base_time)
        self.current.forget(own)

    def _in_image(self, samples: Samples) -> Samples:
        return self._image.to_image(samples) if isinstance(self._image, DynamicResolution) else samples
