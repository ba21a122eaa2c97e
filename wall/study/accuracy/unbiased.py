"""Noisy light at rest: the light of the whole image is that of independent samples, whatever was filtered before."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np

from wall.config.loading import load
from wall.core.data import Float64
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.sampling.pixel_means import PixelMeans, footprint_of
from wall.study.accuracy.case import Case, Found, difference, picture
from wall.study.accuracy.scenes import with_every_feature
from wall.study.quality.command import SCENES_FOLDER
from wall.study.quality.method import Setup
from wall.study.quality.methods_adaptive import AdaptiveMethod
from wall.study.quality.methods_progressive import ProgressiveMethod
from wall.study.quality.trial import on_one_panel
from wall.tracing.tracer_scene import make_tracer_scene

EDGE = 32  # pixels
REFRESH_HZ, EACH = 60.0, 4  # refreshes a second, and samples a pixel between two
REFERENCE = 2  # times as many samples a pixel, of another seed
WHITE = 1.0
METHODS = {"adaptive": AdaptiveMethod, "progressive": ProgressiveMethod}


def still(scene: str) -> Plan:
    """A scene of configs/measure on one small panel, where nothing moves."""
    loaded = load(SCENES_FOLDER / f"{scene}.yaml")
    config = loaded.config
    update = {
        "scene": config.scene.model_copy(update={"animation": ()}),
        "views": (config.views[0].model_copy(update={"path": None}),),
    }  # fmt: skip
    plan = make_plan(make_layout(on_one_panel(loaded.with_config(config.model_copy(update=update)), (EDGE, EDGE))))
    return replace(plan, scene=with_every_feature(plan.scene))


def bias(scene: str, method: str, spp: int) -> Found:
    """How far the mean of an image is from the reference's, relative, of the channel where that is most.

    Light counts up to a display's white: `adaptive` leaves pixels that are white whatever their other samples find.
    """
    setup = _setup(scene)
    wall, shown = METHODS[method](setup), np.empty(0)
    for k in range(spp // EACH):
        wall.advance((k + 1) / REFRESH_HZ)
        shown = wall.show((k + 1) / REFRESH_HZ)
    reference = _reference(scene, REFERENCE * spp)
    means = [np.minimum(image, WHITE).mean(axis=(0, 1), dtype=np.float64) for image in (shown, reference)]
    ratio = means[0] / means[1]
    channels = ", ".join(f"{value:.5f}" for value in ratio)
    pictures = picture("shown", shown), picture("reference", reference), difference("apart", shown, reference)
    note = f"{channels} of the reference, R, G, B; {wall.rays / EDGE**2:,.0f} samples a pixel"
    return Found(figure=float(np.abs(ratio - 1.0).max()), note=note, pictures=pictures)


@cache
def _setup(scene: str) -> Setup:
    plan = still(scene)
    return Setup(
        plan=plan, tracer_scene=make_tracer_scene(plan.scene), rate=EACH * EDGE**2 * REFRESH_HZ, refresh_hz=REFRESH_HZ,
        seed=1, input_step_s=1.0 / REFRESH_HZ,
    )  # fmt: skip


@cache
def _reference(scene: str, spp: int) -> Float64:
    """(h, w, 3) mean of so many samples a pixel."""
    setup = _setup(scene)
    tracer, means = setup.tracer(coherent=True), PixelMeans(setup.rect, seed=setup.seed + 1)
    tracer.seed = setup.seed + 1
    tracer.set_event(first_event(setup.plan, 0.0))
    for k in range(spp):
        means.add(tracer.trace(means.positions(k), footprint_of(k + 1), k)[0])
    return np.asarray(means.mean(), np.float64)


CASES = tuple(
    Case(
        name=f"unbiased_{scene}_{method}", family="Noisy light at rest", unit="of the mean", bound=0.002,
        reason="an image at rest has the light that paths find, no more and no less: no viewer sees 0.2 %",
        scene=f"`configs/measure/{scene}.yaml` where nothing moves, {EDGE}x{EDGE} pixels, by `{method}`, against "
        f"{REFERENCE} times as many samples of another seed",
        measure=partial(bias, scene, method), size=4096, small=None,
    )
    for scene in ("bounce", "metal", "lamps")
    for method in METHODS
)  # fmt: skip
