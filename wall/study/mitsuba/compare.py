"""`wall measure reference`: the same scene by `wall` and by Mitsuba 3, compared pixel by pixel.

Both render BATCHES independent images. Each pixel's difference of means is held against its own variance (Welch's t);
with n pixels a pixel fails below the Sidak level 1 - (1 - LEVEL)^(1/n). So noise fails one image in 100, whatever its
size.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from wall.commands.render import render
from wall.config.loading import load
from wall.core.colour import LUMINANCE, srgb_encoded
from wall.core.data import Float64
from wall.core.errors import RunError
from wall.roles.plan import Plan, make_layout, make_plan
from wall.study.mitsuba.description import describe
from wall.study.mitsuba.library import libllvm

BATCHES = 16
LEVEL = 0.01  # of the whole image
FEWEST_PASSES = 0.9975  # of pixels
MEAN_BOUND = 0.005  # relative
BLACK = 1e-9  # of a mean: a channel without light is the same in both
SHOWN_ERROR = 5.0  # times the difference in the picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One configuration against Mitsuba."""

    config: str
    spp: int
    mean: list[float]  # of our image, RGB
    ratio: list[float]  # of the means, ours over theirs
    passed: float  # share of pixels whose difference is noise
    rmse: float  # of both images, noise included
    cpu_s: float  # of our process, compiling left out
    mitsuba_cpu_s: float
    mitsuba: str  # version and variant
    materials: str  # "formulas" or "mitsuba"
    ok: bool


def compare(config: Path, *, spp: int, out: Path, say: Callable[[str], None], own: bool = False) -> Row:
    """Renders both, writes a picture of both and of their difference to `out`. Raises ConfigError, RunError.

    own : materials are Mitsuba's own, where it has any that are near; else plugins evaluate the published formulas
    """
    plan = make_plan(make_layout(load(config)))
    each = max(1, spp // BATCHES)
    mi, variant = _mitsuba()
    description = describe(mi, plan, spp=each, own=own)
    scene = mi.load_dict(description)
    _ours(plan, 1, BATCHES + 1), _theirs(mi, scene, 1, BATCHES + 1)  # compiled
    ours, theirs, seconds = [], [], np.zeros(2)
    for seed in range(BATCHES):
        say(f"{config.stem}: image {seed + 1} of {BATCHES}")
        began = time.process_time()
        ours.append(_ours(plan, each, seed + 1))
        between = time.process_time()
        theirs.append(_theirs(mi, scene, each, seed + 1))
        seconds += between - began, time.process_time() - between
    a, b = np.array(ours), np.array(theirs)
    mean, other = a.mean(axis=0), b.mean(axis=0)
    ratio = (mean.mean(axis=(0, 1)) + BLACK) / (other.mean(axis=(0, 1)) + BLACK)
    passed = passing(a, b)
    out.mkdir(parents=True, exist_ok=True)
    _picture(mean, other).save(out / f"{config.stem}.png")
    ok = passed >= FEWEST_PASSES and bool((np.abs(ratio - 1.0) <= MEAN_BOUND).all())
    return Row(
        config=config.stem, spp=each * BATCHES, mean=mean.mean(axis=(0, 1)).tolist(), ratio=ratio.tolist(),
        rmse=float(np.sqrt(((mean - other) ** 2).mean())), cpu_s=float(seconds[0]), mitsuba_cpu_s=float(seconds[1]),
        mitsuba=f"{mi.__version__} {variant}", passed=passed, ok=ok,
        materials="mitsuba" if own else "formulas",
    )  # fmt: skip


def passing(a: Float64, b: Float64) -> float:
    """Share of pixels whose luminances in two sets of images (n, h, w, 3) differ by no more than noise does."""
    from scipy.stats import t as student

    a, b = a @ LUMINANCE, b @ LUMINANCE
    spread_a, spread_b = a.var(axis=0, ddof=1) / len(a), b.var(axis=0, ddof=1) / len(b)
    spread = spread_a + spread_b
    apart = np.abs(a.mean(axis=0) - b.mean(axis=0))
    freedom = spread**2 / np.maximum(spread_a**2 / (len(a) - 1) + spread_b**2 / (len(b) - 1), 1e-300)
    level = 1.0 - (1.0 - LEVEL) ** (1.0 / apart.size)
    same = apart <= 1e-4 * np.maximum(a.mean(axis=0), b.mean(axis=0)) + 1e-9  # nothing random, but float32
    chance = 2.0 * student.sf(apart / np.sqrt(np.maximum(spread, 1e-300)), np.maximum(freedom, 1.0))
    return float((same | (chance > level)).mean())


def _mitsuba() -> tuple[Any, str]:
    """Mitsuba's module and the variant chosen: LLVM where there is one, else the scalar one."""
    if find_spec("mitsuba") is None:
        raise RunError("wall measure reference needs mitsuba: pip install -e '.[measure]' in the clone")
    library = libllvm()
    if library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = library
    import mitsuba

    variant = "scalar_rgb" if library is None else "llvm_ad_rgb"
    mitsuba.set_variant(variant)
    return mitsuba, variant


def _ours(plan: Plan, spp: int, seed: int) -> Float64:
    image = render(plan, spp=spp, seed=seed, at=0.0)
    assert image is not None  # there is one rank
    return image.astype(np.float64)


def _theirs(mi: Any, scene: Any, spp: int, seed: int) -> Float64:
    return np.array(mi.render(scene, spp=spp, seed=seed), np.float64)[:, :, :3]


def _picture(ours: Float64, theirs: Float64) -> Image.Image:
    """Ours, theirs, and SHOWN_ERROR times their difference about grey."""
    shown = [srgb_encoded(ours), srgb_encoded(theirs)]
    shown.append(np.clip(0.5 + SHOWN_ERROR * (shown[0] - shown[1]), 0.0, 1.0))
    return Image.fromarray(np.round(np.concatenate(shown, axis=1) * 255).astype(np.uint8))
