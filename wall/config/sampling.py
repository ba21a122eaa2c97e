"""Models of `sampling:`: which pixels are traced next, and how new samples replace old ones."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias, get_args

from annotated_types import Ge, Gt, Le
from pydantic import BeforeValidator, Field

from wall.core.fields import Depth, Model, Number, Whole

LARGEST_STAGE = 65536  # samples a pixel of the progressive method


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


class ProgressiveSampling(_Common):
    """Stages of ever more samples a pixel while the input rests; a coarse image at once when it does not."""

    method: Literal["progressive"] = Field(
        default="progressive", description="ever more samples a pixel, tile by tile; starts over at each input"
    )
    samples_per_batch: Annotated[Whole, Ge(64), Le(65536)] = Field(
        default=2048, description="samples traced under one event; an input breaks a stage off after one batch"
    )
    first_stage: Annotated[Whole, Ge(1), Le(1024)] = Field(
        default=8, description="samples a pixel of the first stage; each one has twice as many as the one before"
    )
    samples_per_pixel: Annotated[Whole, Ge(1), Le(LARGEST_STAGE)] = Field(
        default=4096, description="samples a pixel at which it ends"
    )
    rest_s: Annotated[Number, Ge(0.0), Le(60.0)] = Field(default=0.5, description="seconds between stages")
    target_hz: Annotated[Number, Ge(0.5), Le(240.0)] = Field(
        default=15.0, description="images a second while the input changes: samples get fewer to hold it"
    )
    first_depth: Depth = Field(
        default=4, description="surfaces of the first stage's paths; one more each stage, up to the integrator's"
    )


AnySampling: TypeAlias = AdaptiveSampling | FramedSampling | FramelessSampling | HilbertSampling | ProgressiveSampling
_KINDS: dict[str, type[AnySampling]] = {kind.model_fields["method"].default: kind for kind in get_args(AnySampling)}
METHODS = tuple(_KINDS)
DEFAULT = AdaptiveSampling()  # the least error of a running wall under `wall measure live`, see docs/lab/live.md


def _with_method(value: Any) -> Any:
    return {"method": DEFAULT.method, **value} if isinstance(value, dict) else value


SamplingConfig = Annotated[Annotated[AnySampling, Field(discriminator="method")], BeforeValidator(_with_method)]


def switched(sampling: AnySampling, method: str) -> AnySampling:
    """The same threads, batch and seed under another method of METHODS; hilbert takes its own defaults."""
    if method == sampling.method:
        return sampling
    return _KINDS[method](threads=sampling.threads, samples_per_batch=sampling.samples_per_batch, seed=sampling.seed)
