"""Stored hits under extreme views: wide and narrow, an eye in the panel or in a surface, points behind the eye."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from wall.config.screens import GridConfig, WallConfig
from wall.core.data import Float64
from wall.deepbuffer.kernels.reproject import OUTSIDE, pixel_of, position_of
from wall.deepbuffer.pose import Pose
from wall.geometry.cameras import look_at
from wall.geometry.expanding import expand
from wall.geometry.frusta import ray_frame
from wall.scene.model import Instance
from wall.study.accuracy.case import Case, Found
from wall.study.accuracy.scenes import View, instance, turned, view

ROUNDING = 2.0**-24
OBJECT = instance(0, at=(0.3, -0.2, 0.5), turn=("z", 33.0), scale=0.7).world_from_object
SEED = 15


def hits_in(seen: View, count: int, nearest: float, farthest: float) -> Float64:
    """(n, 3): float32 positions all over the panel, its corners among them, and depths; as float64."""
    random = np.random.default_rng(SEED)
    width, height = seen.panel.pixels
    hits = random.uniform((0.0, 0.0, nearest), (width, height, farthest), (count, 3))
    hits[:4, :2] = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
    hits[:, :2] = np.minimum(hits[:, :2], np.nextafter(np.array([width, height], np.float32), np.float32(0)))
    return np.asarray(hits.astype(np.float32), np.float64)


def there(hits: Float64, traced: Pose, shown: Pose, object_id: int = 1) -> Float64:
    """(n, 3): x, y, and depth along the panel's axis (or OUTSIDE), where stored hits (n, 3) come to lie."""
    found = []
    for x, y, depth in hits:
        a, b, c = position_of(
            traced.corner[0] + x, traced.corner[1] + y, np.float32(depth), object_id, traced.frame,
            traced.object_from_eye,
        )  # fmt: skip
        found.append(pixel_of(np.float32(a), np.float32(b), np.float32(c), object_id, shown.panel_from_object))
    return np.array(found, np.float64).reshape(-1, 3)


class Back(NamedTuple):
    """Hits under their own event: how far off they come back."""

    error: Float64  # (n,) pixels; infinite where they are not seen
    rounding: Float64  # (n,) pixels that one rounding of float32 moves them


def back_again(seen: View, hits: Float64) -> Back:
    """Brings hits (n, 3) to object space and back.

    An error of one rounding of the distance across a ray at the tangent t moves its image by f (1 + t^2) roundings, f
    being the focal length in pixels; it changes the depth by sqrt(1 + t^2), by which positions, counted from the
    panel's corner, are divided. An object whose middle is farther away than the hit is rounded as much more.
    """
    pose = Pose.of(seen.panel, seen.eye, seen.event.camera, OBJECT[None])
    found = there(hits, pose, pose)
    frame = ray_frame(seen.panel, seen.eye, seen.event.camera)
    rays = frame[0] + (hits[:, :2] + seen.panel.screen) @ frame[1:]
    axis = np.cross(frame[1], frame[2])
    ahead = np.abs(rays @ axis) / np.linalg.norm(axis)
    focal = ahead[0] / np.linalg.norm(frame[1])
    square = (rays**2).sum(axis=1) / ahead**2  # 1 + t^2
    far = 1.0 + float(np.linalg.norm(OBJECT[:3, 3] - seen.event.camera.origin())) / hits[:, 2]
    rounding = ROUNDING * far * (focal * square + np.abs(hits[:, :2]).max(axis=1) * np.sqrt(square))
    error = np.abs(found[:, :2] - hits[:, :2]).max(axis=1)
    error[found[:, 2] == OUTSIDE] = np.inf
    return Back(error, rounding)


def came_back(seen: View, count: int) -> Found:
    """Largest error of hits 3 to 9 units away that come back, in roundings."""
    back = back_again(seen, hits_in(seen, count, 3.0, 9.0))
    return Found(figure=float((back.error / back.rounding).max()), note=f"at most {back.error.max():.3g} pixels")


def field_of_view(fov: float, count: int) -> Found:
    """`came_back` for a vertical field of view, degrees."""
    return came_back(view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=(480, 270), fov=fov), count)


def near_the_panel(metres: float, count: int) -> Back:
    """`back_again` for an eye so far before a panel's plane, beside the panel's middle."""
    seen = view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=(480, 270))
    seen = replace(seen, eye=np.array([0.11, -0.07, metres]))
    return back_again(seen, hits_in(seen, count, 3.0, 9.0))


def pixels_off(metres: float, count: int) -> Found:
    """Largest error, pixels."""
    back = near_the_panel(metres, count)
    roundings = float((back.error / back.rounding).max())
    return Found(figure=float(back.error.max()), note=f"{roundings:.2g} roundings")


def roundings_off(metres: float, count: int) -> Found:
    """Largest error, roundings."""
    back = near_the_panel(metres, count)
    note = f"at most {back.error.max():.3g} pixels, where one rounding is up to {back.rounding.max():.3g}"
    return Found(figure=float((back.error / back.rounding).max()), note=note)


def thin_panel(count: int) -> Found:
    """`came_back` for a panel of 16,384 x 1 pixels."""
    seen = view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=(480, 270))
    grid = GridConfig(columns=1, rows=1, pixels=(16384, 1), size=(16.384, 0.001))
    return came_back(replace(seen, wall=expand(WallConfig(grid=grid)), eye=np.array([0.0, 0.0, 9.0])), count)


def through_geometry(count: int) -> Found:
    """`came_back` for hits 1 to 1e-6 units before the eye, of an object whose middle is 6 units away."""
    seen = view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=(480, 270))
    worst = Found(figure=0.0)
    for nearest in 10.0 ** -np.arange(7.0):
        back = back_again(seen, hits_in(seen, count, nearest, 1.5 * nearest))
        seen_ones = np.isfinite(back.error)  # within roundings of the eye some are behind it
        figure = float((back.error / back.rounding)[seen_ones].max(initial=0.0))
        if figure >= worst.figure:
            worst = Found(
                figure=figure, note=f"worst {nearest:g} before the eye, where {seen_ones.mean():.0%} are seen"
            )
    return worst


def behind_the_eye(count: int) -> Found:
    """Points behind an eye, or 100 roundings or more before it, that are taken for the other."""
    seen = view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=(480, 270))
    random = np.random.default_rng(SEED)
    hits = hits_in(seen, count, 3.0, 9.0)
    before = seen.event.camera
    wrong = finite = 0
    traced = Pose.of(seen.panel, seen.eye, before, OBJECT[None])
    axis = -before.rotation()[:, 2]
    for _ in range(16):
        ahead = float(random.uniform(2.0, 10.0))
        turn = turned("y", float(random.uniform(-20.0, 20.0)))
        eye = before.origin() + ahead * axis
        after = look_at(eye, eye + turn @ axis, (0.0, 1.0, 0.0))
        found = there(hits, traced, Pose.of(seen.panel, seen.eye, after, OBJECT[None]))
        frame = ray_frame(seen.panel, seen.eye, before)
        rays = frame[0] + (hits[:, :2] + seen.panel.screen) @ frame[1:]
        points = before.origin() + rays * (hits[:, 2:] / np.linalg.norm(rays, axis=1, keepdims=True))
        depth = (points - eye) @ (turn @ axis)
        sure = np.abs(depth) > 100 * ROUNDING * 20.0
        wrong += int(((found[:, 2] > 0.0) != (depth > 0.0))[sure].sum())
        shown = found[found[:, 2] > 0.0]
        finite += int((~np.isfinite(shown)).any(axis=1).sum())
    return Found(figure=wrong + finite, note=f"of {16 * count:,}; {finite} not finite")


def flattened(count: int) -> Found:
    """Hits of objects squashed to nothing along an axis that come to a pixel which is not a number."""
    wrong = 0
    seen = view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=(480, 270))
    for axis in range(3):
        matrix = OBJECT.copy()
        matrix[:, axis] = 0.0
        placed = Instance(name="flat", mesh=0, world_from_object=matrix).world_from_object
        pose = Pose.of(seen.panel, seen.eye, seen.event.camera, placed[None])
        found = there(hits_in(seen, count, 3.0, 9.0), pose, pose)
        wrong += int((~np.isfinite(found[found[:, 2] > 0.0])).any(axis=1).sum())
    return Found(figure=wrong)


_FAMILY = "Reprojection"
_UNIT = "roundings"
_REASON = (
    "a hit is rounded into object space and back, three products and three sums each way, and divided by its depth: 8 "
    "roundings of the distance across the ray, of which a pixel at the tangent t sees f (1 + t^2) + x sqrt(1 + t^2)"
)
CASES = (
    *(
        Case(
            name=f"field_of_view_{fov:g}", family=_FAMILY, unit=_UNIT, bound=8.0, reason=_REASON,
            scene=f"Hits all over a panel of 480 x 270 with a field of view of {fov:g} degrees",
            measure=partial(field_of_view, fov), size=5000, small=100,
        )
        for fov in (1.0, 45.0, 120.0, 170.0)
    ),
    Case(
        name="eye_1_mm_from_the_panel", family=_FAMILY, unit="pixels", bound=0.5,
        reason="a stored sample has to stay in its pixel",
        scene="The same for an eye 1 mm before the panel's plane", measure=partial(pixels_off, 1e-3),
        size=5000, small=100,
    ),
    Case(
        name="eye_10_um_from_the_panel", family=_FAMILY, unit=_UNIT, bound=8.0,
        reason="the same roundings; but at 89.999 degrees from the panel's axis a pixel is narrower than one rounding "
        "of a direction: rays cannot tell such pixels apart, and stored samples move by some while the camera does",
        scene="The same for an eye 10 um before the panel's plane", measure=partial(roundings_off, 1e-5),
        size=5000, small=100,
    ),
    Case(
        name="thin_panel", family=_FAMILY, unit=_UNIT, bound=8.0, reason=_REASON,
        scene="The same for a panel of 16,384 x 1 pixels", measure=thin_panel, size=5000, small=100,
    ),
    Case(
        name="through_geometry", family=_FAMILY, unit=_UNIT, bound=8.0,
        reason="the same, times the distance of the object's middle over that of the hit",
        scene="An eye 1 to 1e-6 units before a surface, inside an object whose middle is 6 units away",
        measure=through_geometry, size=1000, small=20,
    ),
    Case(
        name="behind_the_eye", family=_FAMILY, unit="points", bound=0.0,
        reason="the sign of the depth is right from 100 roundings of 20 units on; what is behind is never shown",
        scene="Cameras that drive and turn into a cloud of hits", measure=behind_the_eye, size=2000, small=50,
    ),
    Case(
        name="flattened", family=_FAMILY, unit="points", bound=0.0,
        reason="a matrix without an inverse gives zeros, not NaN",
        scene="An object squashed to nothing along each of its axes", measure=flattened, size=2000, small=50,
    ),
)  # fmt: skip
