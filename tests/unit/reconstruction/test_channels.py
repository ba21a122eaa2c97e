"""Channels of framelets against NumPy: of newest samples, of reprojected ones, the sky."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from small_scenes import directions, view

from wall.core.colour import srgb_codes
from wall.core.data import Framelet
from wall.core.tone_mapping import AS_IT_IS, Tone, tone_mapped
from wall.deepbuffer.kernels.pixel_buffer import PIXEL, TILE
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.geometry.frusta import ray_frame
from wall.reconstruction.channels import blank_framelet, show_newest, show_sky
from wall.reconstruction.kernels import channels as kernels
from wall.reconstruction.stored import NearestSamples
from wall.scene.model import Sky

HEIGHT, WIDTH = 2 * TILE - 5, 2 * TILE + 3  # tiles at both edges are cut off
ONE = np.float32(1.0)  # gain
DIRTY = np.array([[True, False, True], [False, True, False]])
EYE = view((1.0, 2.0, 5.0), (0.0, 0.5, 0.0), pixels=(WIDTH, HEIGHT))
FRAME, CORNER = ray_frame(EYE.panel, EYE.eye, EYE.event.camera), np.array(EYE.panel.screen, np.float64)
CHANGED = np.kron(DIRTY, np.ones((TILE, TILE), np.bool_))[:HEIGHT, :WIDTH]


def blank() -> dict[str, np.ndarray]:  # type: ignore[type-arg]
    made = {name: np.full((HEIGHT, WIDTH), 7, np.float32) for name in ("depth", "alpha", "time")}
    return {
        "colour": np.full((HEIGHT, WIDTH, 3), 7, np.float32),
        **made,
        "object_id": np.full((HEIGHT, WIDTH), 7, np.uint32),
    }


def records() -> np.ndarray:  # type: ignore[type-arg]
    rng = np.random.default_rng(1)
    made = np.zeros((HEIGHT, WIDTH), PIXEL)
    made["shown"], made["object_id"] = rng.random((HEIGHT, WIDTH, 3)), rng.integers(0, 3, (HEIGHT, WIDTH))
    made["depth"] = np.where(made["object_id"] == 0, np.inf, rng.uniform(1, 9, (HEIGHT, WIDTH)))
    made["time"] = rng.choice([-np.inf, 1e5 + 0.25, 1e5 - 3.0], (HEIGHT, WIDTH))
    return made


@pytest.mark.parametrize("transparent", [False, True])
def test_channels_of_newest_samples(transparent: bool) -> None:
    r, out = records(), blank()
    kernels.channels_of_records(r, DIRTY, 1e5, transparent, ONE, *out.values())
    nothing = transparent & (r["object_id"] == 0)
    wanted = {
        "colour": np.where(nothing[..., None], 0, r["shown"]), "depth": r["depth"],
        "alpha": np.where(nothing, 0.0, 1.0), "time": r["time"] - 1e5, "object_id": r["object_id"],
    }  # fmt: skip
    for name, values in out.items():
        np.testing.assert_array_equal(values[CHANGED], wanted[name][CHANGED].astype(values.dtype), err_msg=name)
        assert (values[~CHANGED] == 7).all(), f"{name} of a clean tile was written"


def test_channels_that_nobody_wants_are_left_out() -> None:
    out = blank()
    kernels.channels_of_records(records(), DIRTY, 0.0, True, ONE, None, out["depth"], None, None, None)
    np.testing.assert_array_equal(out["depth"][CHANGED], records()["depth"][CHANGED])


def near_of(rng: np.random.Generator) -> np.ndarray:  # type: ignore[type-arg]
    """(h, w, 4) as find_nearest leaves it: depth along the axis, .., .., object; -1 where no sample is."""
    nearest = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    nearest[..., 3] = rng.choice([-1, 0, 1, 2], (HEIGHT, WIDTH))
    nearest[..., 0] = np.where(nearest[..., 3] > 0, rng.uniform(1, 9, (HEIGHT, WIDTH)), 1e30)
    return nearest


def twin(nearest: np.ndarray, covered: np.ndarray | None) -> tuple[np.ndarray, ...]:  # type: ignore[type-arg]
    """Depth, object, alpha, and whether the colour is cleared."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    rays = FRAME[0] + (x + CORNER[0])[..., None] * FRAME[1] + (y + CORNER[1])[..., None] * FRAME[2]
    length = np.linalg.norm(rays, axis=-1)
    depth, object_id = np.full((HEIGHT, WIDTH), np.inf), np.zeros((HEIGHT, WIDTH), np.uint32)
    alpha = np.ones((HEIGHT, WIDTH)) if covered is None else np.clip(covered[..., 0], 0.0, 1.0)
    for i, j in np.argwhere(alpha > 0):
        found = nearest[i, j]
        if not (found[3] > 0 or (found[3] == 0 and covered is None)):
            around = nearest[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2].reshape(-1, 4)
            around = around[around[:, 3] > 0]
            if not len(around):
                continue
            found = around[np.argmin(around[:, 0])]
        object_id[i, j] = found[3]
        if found[0] < 1e30:
            depth[i, j] = found[0] * length[i, j]
    cleared = np.zeros_like(object_id, np.bool_)
    if covered is not None:
        cleared = np.isinf(depth) & (nearest[..., 3] == 0)
        alpha = np.where(cleared, 0.0, alpha)
    return depth, object_id, alpha, cleared


@pytest.mark.parametrize("partly", [False, True])
def test_depth_object_and_alpha_of_reprojected_samples(partly: bool) -> None:
    rng = np.random.default_rng(2)
    nearest, out = near_of(rng), blank()
    nearest[:8, :8, 3] = 0.0  # background, with nothing beside it
    covered = rng.choice([-0.1, 0.3, 1.2], (HEIGHT, WIDTH, 3)).astype(np.float32) if partly else None
    channels = (out["colour"], out["alpha"], out["depth"], out["object_id"])
    found = NearestSamples(nearest[..., 0], nearest[..., 3])
    kernels.channels_of_nearest(found, FRAME, CORNER, covered, DIRTY, *channels)
    depth, object_id, alpha, cleared = twin(nearest, covered)
    assert (cleared & CHANGED).any() == partly
    np.testing.assert_allclose(out["depth"][CHANGED], depth[CHANGED], rtol=1e-5)
    np.testing.assert_allclose(out["alpha"][CHANGED], alpha[CHANGED], rtol=1e-6)
    np.testing.assert_array_equal(out["object_id"][CHANGED], object_id[CHANGED])
    gone = cleared & CHANGED
    assert (out["colour"][gone] == 0).all()
    assert (out["colour"][~gone] == 7).all()
    assert (out["depth"][~CHANGED] == 7).all()


def test_newest_times_are_those_of_the_samples_that_count() -> None:
    rng = np.random.default_rng(3)
    n = 200
    state = np.stack([rng.uniform(-5, 0, n), rng.choice([0.0, 0.5, 1.0], n)]).astype(np.float32)
    screen = np.stack([rng.uniform(0, WIDTH, n), rng.uniform(0, HEIGHT, n), rng.choice([-1.0, 2.0], n)]).astype(
        np.float32
    )
    time = np.full((HEIGHT, WIDTH), 7, np.float32)
    kernels.newest_times(*state, screen, n - 20, 2.0, time)
    wanted = np.full((HEIGHT, WIDTH), -np.inf)
    for k in range(n - 20):  # what stands behind the count is not looked at
        if screen[2, k] > 0 and state[1, k] > 0:
            i, j = int(screen[1, k]), int(screen[0, k])
            wanted[i, j] = max(wanted[i, j], state[0, k] + 2.0)
    np.testing.assert_allclose(time, wanted, rtol=1e-6)


def test_the_sky_is_that_of_each_pixel_s_direction() -> None:
    zenith, horizon, ground = np.array([0.1, 0.2, 0.9]), np.array([0.8, 0.8, 0.7]), np.array([0.3, 0.2, 0.1])
    colour = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    kernels.sky_of_panel(FRAME, CORNER, zenith, horizon, ground, colour)
    up = directions(EYE)[..., 1:2]
    wanted = horizon + (np.where(up > 0, zenith, ground) - horizon) * np.abs(up)
    assert (up > 0).any()
    assert (up < 0).any()
    np.testing.assert_allclose(colour, wanted, rtol=1e-5)


def test_only_dirty_tiles_are_copied() -> None:
    source, out = np.random.default_rng(4).random((HEIGHT, WIDTH, 3), np.float32), blank()["colour"]
    kernels.copy_tiles(source, DIRTY, ONE, out)
    np.testing.assert_array_equal(out, np.where(CHANGED[..., None], source, np.float32(7)))


@pytest.mark.parametrize("mapping", ["none", "khronos_neutral"])
def test_light_for_operators_is_exposed_and_mapped_wherever_it_comes_from(mapping: str) -> None:
    """Newest samples in dirty tiles, and the sky; display bytes of the same light are within a code."""
    tone, sky = Tone(1.0, mapping), Sky(zenith=(0.2, 0.5, 1.0), horizon=(0.1, 0.6, 2.0), ground=(0.1, 0.1, 0.1))
    buffer, everything = PixelBuffer(WIDTH, HEIGHT), np.ones_like(DIRTY)
    buffer.records["shown"], buffer.records["object_id"] = 3.0 * records()["shown"], 1

    def both(show: Callable[[Framelet, Tone], None]) -> tuple[Framelet, Framelet, Framelet]:
        made = [blank_framelet(EYE.panel, frozenset({"colour"}), encoded=k == 2, order=0) for k in range(3)]
        for framelet, each in zip(made, (AS_IT_IS, tone, tone), strict=True):
            show(framelet, each)
        return made[0], made[1], made[2]

    for plain, mapped, shown in (
        both(lambda out, tone: show_newest(buffer, everything, False, out, tone=tone)),
        both(lambda out, tone: show_sky(sky, None, FRAME, CORNER, out, tone=tone)),
    ):
        np.testing.assert_allclose(mapped.colour, tone_mapped(2.0 * plain.colour, mapping), rtol=1e-5, atol=1e-6)
        assert np.abs(srgb_codes(mapped.colour).astype(int) - shown.colour).max() <= 1
        assert np.ptp(shown.colour) > 50
