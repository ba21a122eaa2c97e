"""Models of `sampling:`: which pixels are traced next, and how new samples replace old ones."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias, get_args

from annotated_types import Ge, Gt, Le
from pydantic import BeforeValidator, Field

from wall.core.fields import Model, Number, Whole


class _Common(Model):
    threads: Annotated[Whole, Ge(1), Le(256)] = Field(
        default=1, description="worker threads of one rank; each owns its pixels"
    )
    samples_per_batch: Annotated[Whole, Ge(64), Le(65536)] = Field(
        default=4096, description="samples traced under one event"
    )
    seed: Annotated[Whole, Ge(0), Le(2**32 - 1)] = Field(default=1, description="seed of every random choice")


class AdaptiveSampling(_Common):
    """Rays where the image gains most, samples kept and reprojected (after Dayal et al. 2005)."""

    method: Literal["adaptive"] = Field(
        default="adaptive", description="rays where the image changes; samples follow camera and objects"
    )
    samples_per_batch: Annotated[Whole, Ge(64), Le(65536)] = Field(
        default=2048, description="samples traced under one event; fewer than other samplers, since rays are fewer"
    )
    samples_per_pixel: Annotated[Number, Ge(1.0), Le(16.0)] = Field(
        default=2.0, description="samples kept, on average; more = smoother and slower"
    )
    tiling: Literal["grid", "cut"] = Field(
        default="grid", description="grid = 16-pixel tiles; cut = tiles of about equal importance, from a K-D cut"
    )


class FramedSampling(_Common):
    """Every pixel once, shown when the frame is complete: the double-buffered baseline."""

    method: Literal["framed"] = Field(default="framed", description="whole frames, double-buffered")


class FramelessSampling(_Common):
    """Pixels in random order, each under the newest input, shown at once (Bishop et al. 1994)."""

    method: Literal["frameless"] = Field(default="frameless", description="random order, each sample shown at once")


class HilbertSampling(_Common):
    """Chunks of a Hilbert curve, permuted by their workers, blended into the image (Parker et al. 1999)."""

    method: Literal["hilbert"] = Field(default="hilbert", description="permuted chunks of a Hilbert curve, blended")
    chunk_pixels: Annotated[Whole, Ge(4), Le(65536)] = Field(default=64, description="pixels of one chunk of the curve")
    camera_update_percent: Annotated[Number, Gt(0.0), Le(100.0)] = Field(
        default=2.0, description="a worker takes the newest camera every so many percent of its pixels"
    )
    blend: Annotated[Number, Gt(0.0), Le(1.0)] = Field(
        default=0.5, description="weight of a new sample against the image before it; 1 replaces"
    )


AnySampling: TypeAlias = AdaptiveSampling | FramedSampling | FramelessSampling | HilbertSampling
_KINDS: dict[str, type[AnySampling]] = {kind.model_fields["method"].default: kind for kind in get_args(AnySampling)}
METHODS = tuple(_KINDS)


def _with_method(value: Any) -> Any:
    return {"method": "frameless", **value} if isinstance(value, dict) else value


SamplingConfig = Annotated[Annotated[AnySampling, Field(discriminator="method")], BeforeValidator(_with_method)]


def switched(sampling: AnySampling, method: str) -> AnySampling:
    """The same threads, batch and seed under another method of METHODS; hilbert takes its own defaults."""
    if method == sampling.method:
        return sampling
    return _KINDS[method](threads=sampling.threads, samples_per_batch=sampling.samples_per_batch, seed=sampling.seed)
