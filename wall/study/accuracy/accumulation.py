"""Means, variances and ages over very many samples, and over days."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from wall.core.data import SAMPLE, Event, Float32, Framelet, Rect, Samples
from wall.deepbuffer.kernels.columns import COUNT, LUMINANCE_DEVIATIONS
from wall.reconstruction.reconstruction import Reconstruction
from wall.sampling.kernels import adaptive as kernels
from wall.sampling.pixel_means import PixelMeans
from wall.sampling.tiles import Grid
from wall.scene.model import Material
from wall.study.accuracy.case import Case, Found
from wall.study.accuracy.scenes import View, quad, scene_of, view

BATCH = 4096
PIXEL = (20.5, 11.5)
SEEN: View = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(48, 32))
DAY_S = 86_400.0


def equal_samples(value: float, count: int) -> Found:
    """Relative error of the mean of one pixel's equal samples at rest."""
    image = accumulated(np.full((count, 3), value, np.float32))
    return Found(figure=abs(float(image.radiance[11, 20, 0]) / value - 1.0))


def random_samples(count: int) -> Found:
    """Relative error of the mean of one pixel's random samples at rest."""
    values = np.random.default_rng(15).gamma(1.0, 0.7, (count, 3)).astype(np.float32)
    mean = values.astype(np.float64).mean(axis=0)
    return Found(figure=float(np.abs(accumulated(values).radiance[11, 20] / mean - 1.0).max()))


def alternating_variance(count: int) -> Found:
    """Relative error of the variance of luminance of a pixel that is 0.1 and 0.9 in turn, as samplers are told it."""
    values = np.repeat(np.array([0.1, 0.9], np.float32)[np.arange(count) % 2, None], 3, axis=1)
    pixel = accumulated(values).buffer.history.accumulation[11, 20]
    wanted = float(values[:, 0].astype(np.float64).var())
    return Found(figure=abs(float(pixel[LUMINANCE_DEVIATIONS]) / float(pixel[COUNT]) / wanted - 1.0))


def accumulated(values: Float32) -> Reconstruction:
    """An image at rest after one pixel got these samples (n, 3)."""
    glowing = Material(name="glowing", base_color=(0.0, 0.0, 0.0), emission=(1.0, 1.0, 1.0))
    image = Reconstruction(
        SEEN.panel, SEEN.eye, scene_of([quad(40.0, 40.0)], materials=[glowing]), detects_change=False
    )
    event: Event = SEEN.event
    image.refresh(event, event.input_time)
    for begin in range(0, len(values), BATCH):
        image.insert(_hits(values[begin : begin + BATCH]), event.input_time + 1.0, event)
    image.refresh(event, event.input_time + 1.0)
    return image


def _hits(values: Float32) -> Samples:
    samples = np.zeros(len(values), SAMPLE)
    samples["xy"], samples["radiance"], samples["depth"], samples["object_id"] = PIXEL, values, 4.0, 1
    return samples


def rendered_mean(count: int) -> Found:
    """Relative error of a pixel's mean in `wall render` after so many samples."""
    rect = Rect(x=0, y=0, width=1, height=1)
    means, total = PixelMeans(rect, seed=1), 0.0
    random = np.random.default_rng(15)
    for begin in range(0, count, BATCH):
        values = random.gamma(1.0, 0.7, (min(BATCH, count - begin), 3)).astype(np.float32)
        samples = _hits(values)
        samples["xy"] = 0.5
        means.add(samples)
        total += float(values[:, 0].astype(np.float64).sum())
    return Found(figure=abs(float(means.mean()[0, 0, 0]) / (total / count) - 1.0))


def framelet_ages(days: float, step_s: int) -> Found:
    """Largest error of a framelet's times, in float32 steps of the age, after days of refreshes `step_s` apart."""
    framelet = Framelet.blank(Rect(x=0, y=0, width=4, height=1), frozenset({"time"}))
    assert framelet.time is not None
    start = 1000.0
    framelet.stamp(start)
    traced = np.array([start - 1.0, start - 0.125, start])
    framelet.time[0, :3] = traced - framelet.time_origin
    refreshes = int(days * DAY_S / step_s)
    for k in range(1, refreshes + 1):
        framelet.stamp(start + k * step_s)
    ages = start + refreshes * step_s - traced
    found = framelet.time_origin + framelet.time[0, :3].astype(np.float64)
    steps = np.abs(found - traced) / np.spacing(ages.astype(np.float32))
    never = framelet.time[0, 3] == -np.inf
    return Found(
        figure=float(steps.max()) if never else math.inf, note=f"{refreshes:,} refreshes, {ages[0]:,.0f} s old"
    )


def many_visits(count: int) -> Found:
    """How uneven so many positions in a pixel are where the number of its visits begins anew, over what chance gives.

    The largest difference between the share of positions in a part [0, a) x [0, b) of the pixel, or in one of the other
    three corners, and its area. Chance: the standard deviation of the share of so many random positions in a half.
    """
    visits = np.full((1, 1), np.iinfo(np.uint16).max - count // 2, np.uint16)
    xy = np.empty((count, 2), np.float32)
    score = np.ones((1, 1), np.float32)
    kernels.draw(score, Grid(1, 1).tiles, kernels.Pixels(visits, 1, 0, 0), 1, xy)
    if not ((xy >= 0.0) & (xy < 1.0)).all():
        return Found(figure=math.inf, note="some are outside")
    edges, worst = np.linspace(0.0, 1.0, 65), 0.0
    for places in (xy, 1.0 - xy, np.stack([xy[:, 0], 1.0 - xy[:, 1]], 1), np.stack([1.0 - xy[:, 0], xy[:, 1]], 1)):
        counts = np.histogram2d(places[:, 0], places[:, 1], bins=[edges, edges])[0].cumsum(0).cumsum(1) / count
        worst = max(worst, float(np.abs(counts - np.outer(edges[1:], edges[1:])).max()))
    again = len(xy) - len(np.unique(xy, axis=0))
    return Found(figure=worst / (0.5 / math.sqrt(count)), note=f"{again} of {count:,} positions come twice")


_FAMILY = "Accumulation and time"
CASES = (
    *(
        Case(
            name=f"equal_samples_{value:g}", family=_FAMILY, unit="of the mean", bound=2.0**-20,
            reason="Welford's mean adds a share of the difference, which is zero: the roundings of the first samples "
            "stay. A float32 sum drifts by 1 %",
            scene=f"One pixel at rest, all samples {value:g}", measure=partial(equal_samples, value), size=1_000_000,
            small=5_000,
        )
        for value in (0.7, 1e-3, 300.0)
    ),
    Case(
        name="random_samples", family=_FAMILY, unit="of the mean", bound=5e-5,
        reason="each of n roundings (standard deviation 2^-24 / sqrt(12)) fades as 1 / n: sqrt(n / 3) of them add "
        "up to 1e-5 of the mean; five times that",
        scene="One pixel at rest, random samples", measure=random_samples, size=1_000_000, small=5_000,
    ),
    Case(
        name="alternating_variance", family=_FAMILY, unit="of the variance", bound=0.05,
        reason="after 10^6 samples of one size a term is 16 float32 steps of the sum, so all may round by 1/32 "
        "the same way; samplers compare variances, and 5 % of one changes no choice",
        scene="One pixel at rest, 0.1 and 0.9 in turn", measure=alternating_variance, size=1_000_000, small=5_000,
    ),
    Case(
        name="many_visits", family=_FAMILY, unit="of chance", bound=1.0,
        reason="visits of a pixel are counted in 16 bits, and its positions begin anew after 65,536: those before and "
        "after are parts of one sequence, together at least as even as chance",
        scene="Positions of the adaptive sampler in one pixel that has been visited 65,536 times", measure=many_visits,
        size=16_384, small=1024,
    ),
    Case(
        name="rendered_mean", family=_FAMILY, unit="of the mean", bound=1e-9,
        reason="sums are float64: 10^6 roundings of 2^-53, all the same way",
        scene="One pixel of `wall render`, random samples", measure=rendered_mean, size=1_000_000, small=5_000,
    ),
    *(
        Case(
            name=f"framelet_ages_{name}", family=_FAMILY, unit="steps of the age", bound=1.0,
            reason="a time is float32 seconds after an origin that moves by 64 s: exact unless its step grows",
            scene=f"A framelet that got no sample for {name.replace('_', ' ')}",
            measure=partial(framelet_ages, days), size=32, small=32 if days < 2 else 64 * 32,
        )
        for name, days in (("24_hours", 1.0), ("30_days", 30.0))
    ),
)  # fmt: skip
