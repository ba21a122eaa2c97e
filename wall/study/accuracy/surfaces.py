"""Textures and normals against closed forms in float64."""

from __future__ import annotations

import math
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_decoded
from wall.core.data import Float64
from wall.scene.model import DirectionalLight, Instance, Sky, Texture, Wrap
from wall.study.accuracy.case import Case, Found, difference, picture
from wall.study.accuracy.scenes import (
    Triple,
    directions,
    material,
    quad,
    raster,
    scene_of,
    sphere_mesh,
    traced_image,
    turned,
    view,
    with_every_feature,
)
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

WHITE: Triple = (1.0, 1.0, 1.0)
WHITE_SKY = Sky(zenith=WHITE, horizon=WHITE, ground=WHITE)
SHAPES = ((1, 1), (1, 7), (3, 5), (16, 16), (17, 31))  # of textures, rows and columns
REPEATS, SHIFT = 3.0, -1.3  # texture coordinates go from -1.3 to 1.7
SEGMENTS = 200
FACING, LIT = 0.2, 0.1  # cosines from which on normals are compared


def bilinear(wrap: Wrap, width: int) -> Found:
    """Largest error of a texture's colour, looked up at points, against the formula in float64."""
    worst, note = -1.0, ""
    seen = view((0.0, 0.0, 12.0), (0.0, 0.0, 0.0), pixels=(width, width), fov=40.0)
    points = np.array([0.0, 0.0, 12.0]) + directions(seen) * (-12.0 / directions(seen)[..., 2:])
    for shape in SHAPES:
        texels = np.random.default_rng(5).integers(0, 256, (*shape, 3)).astype(np.uint8)
        mesh = quad(20.0, 20.0, uvs=True)
        assert mesh.uvs is not None
        mesh.uvs[:] = mesh.uvs * np.float32(REPEATS) + np.float32(SHIFT)
        texture = Texture(name="noise", texels=texels, wrap=(wrap, wrap))
        scene = scene_of([mesh], materials=[material(*WHITE, base_color_texture=0)], textures=[texture], sky=WHITE_SKY)
        tracer = Tracer(make_tracer_scene(with_every_feature(scene)), seen.panel, seen.eye, coherent=True)
        tracer.set_event(seen.event)
        xy = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(width) + 0.5), axis=-1).reshape(-1, 2)
        samples, cost = tracer.trace(xy.astype(np.float32), 0.0)
        got = raster(samples, (width, width), cost).radiance
        wanted = _looked_up(texels, wrap, (points[..., :2] / 20.0 + 0.5) * REPEATS + SHIFT)
        error = float(np.abs(got - wanted).max())
        if error > worst:
            worst, note = error, f"worst with {shape[1]} x {shape[0]} texels"
    shown = (picture("traced", got), picture("in float64", wanted), difference("difference", got, wanted))
    return Found(figure=worst, note=note, pictures=shown)


def _looked_up(texels: NDArray[np.uint8], wrap: Wrap, uv: Float64) -> Float64:
    """(h, w, 3) linear light at texture coordinates (h, w, 2): bilinear between texel centres, v up."""
    light = srgb_decoded(texels / 255.0)
    height, width = light.shape[:2]
    x, y = uv[..., 0] * width - 0.5, (1.0 - uv[..., 1]) * height - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    columns, rows = ([_wrapped(first + k, size, wrap) for k in (0, 1)] for first, size in ((x0, width), (y0, height)))
    upper = (1 - fx) * light[rows[0], columns[0]] + fx * light[rows[0], columns[1]]
    lower = (1 - fx) * light[rows[1], columns[0]] + fx * light[rows[1], columns[1]]
    return np.asarray((1 - fy) * upper + fy * lower, np.float64)


def _wrapped(index: NDArray[np.int64], size: int, wrap: Wrap) -> NDArray[np.int64]:
    if wrap == "repeat":
        return index % size
    if wrap == "clamp":
        return np.clip(index, 0, size - 1)
    twice = index % (2 * size)
    return np.where(twice < size, twice, 2 * size - 1 - twice)


def mean_of_fine_texture(sizes: int) -> Found:
    """Largest relative error of a texture so far away that a sample's footprint holds many of it."""
    worst, note = 0.0, ""
    seen = view((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), pixels=(8, 8), fov=2.0)
    for k in range(sizes):
        shape = (1 + (7 * k) % 37, 1 + (11 * k) % 41)
        texels = np.random.default_rng(k).integers(0, 256, (*shape, 3)).astype(np.uint8)
        mesh = quad(20.0, 20.0, uvs=True)
        assert mesh.uvs is not None
        mesh.uvs[:] *= np.float32(20000.0)
        texture = Texture(name="noise", texels=texels)
        scene = scene_of([mesh], materials=[material(*WHITE, base_color_texture=0)], textures=[texture], sky=WHITE_SKY)
        got = traced_image(with_every_feature(scene), seen).radiance.mean(axis=(0, 1))
        mean = srgb_decoded(texels / 255.0).mean(axis=(0, 1))
        error = float(np.abs(got / np.maximum(mean, 0.05) - mean / np.maximum(mean, 0.05)).max())
        if error > worst:
            worst, note = error, f"worst with {shape[1]} x {shape[0]} texels"
    return Found(figure=worst, note=note)


def normals(scale: Triple, width: int) -> Found:
    """Largest error of the cosine of a smooth ellipsoid under a directional light, against its formula."""
    matrix = np.eye(4)
    matrix[:3, :3] = turned("z", 25.0) @ turned("x", 40.0) @ np.diag(scale)
    light = np.array([0.48, 0.36, 0.8])
    sun = DirectionalLight(direction=(0.48, 0.36, 0.8), irradiance=(math.pi,) * 3)
    placed = Instance(name="it", mesh=0, world_from_object=matrix)
    scene = scene_of([sphere_mesh(segments=SEGMENTS)], [placed], materials=[material(*WHITE)], lights=[sun])
    eye, reach = np.array([0.0, 0.0, 8.0]), max(map(abs, scale))
    fov = 2 * math.degrees(math.atan(1.1 * reach / 8.0))
    seen = view((0.0, 0.0, 8.0), (0.0, 0.0, 0.0), pixels=(width, width), fov=fov)
    got = traced_image(with_every_feature(scene), seen)
    inverse = np.linalg.inv(matrix[:3, :3])
    way, start = directions(seen) @ inverse.T, inverse @ eye
    a, b, c = (way**2).sum(axis=2), way @ start, float(start @ start) - 1.0
    inside = b * b - a * c
    t = (-b - np.sqrt(np.maximum(inside, 0.0))) / a
    point = start + way * t[..., None]
    normal = point @ inverse
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    cosine = normal @ light
    facing = -(point * way).sum(axis=2) / np.sqrt(a)
    compared = (inside > 0.0) & (got.objects == 1) & (facing > FACING) & (cosine > LIT)
    error = np.where(compared, np.abs(got.radiance[..., 0] - cosine), 0.0)
    wanted = np.where(inside > 0.0, np.maximum(cosine, 0.0), 0.0)
    return Found(
        figure=float(error.max()), note=f"of {int(compared.sum()):,} pixels",
        pictures=(
            picture("traced", got.radiance), picture("formula", wanted),
            difference("difference", got.radiance, np.repeat(wanted[..., None], 3, axis=2)),
        ),
    )  # fmt: skip


def far_texture_coordinates(width: int) -> Found:
    """Pixels that are not finite where texture coordinates are huge, not a number, or all the same."""
    wrong, seen = 0, view((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), pixels=(width, width), fov=60.0)
    texture = Texture(name="noise", texels=np.full((3, 5, 3), 128, np.uint8))
    for value in (0.0, 1e-45, 1e9, 3e38, math.inf, math.nan):
        mesh = quad(20.0, 20.0, uvs=True)
        assert mesh.uvs is not None
        mesh.uvs[1] = mesh.uvs[2] = value
        scene = scene_of([mesh], materials=[material(*WHITE, base_color_texture=0)], textures=[texture], sky=WHITE_SKY)
        got = traced_image(with_every_feature(scene), seen)
        wrong += int((~np.isfinite(got.radiance)).any(axis=2).sum())
    return Found(figure=wrong, note=f"of {6 * width**2:,} pixels")


SAGITTA = (math.sqrt(2.0) * math.pi / SEGMENTS) ** 2 / 2  # of half the diagonal of two facets, below the sphere
_FAMILY = "Textures and normals"
CASES = (
    *(
        Case(
            name=f"texture_{wrap}", family=_FAMILY, unit="of white", bound=31 * 1.7 * 64 * 2.0**-24,
            reason="a place is known to 64 roundings of its texture coordinate, of which 31 texels see 31 times",
            scene=f"Textures of 1 x 1 to 31 x 17 texels, {wrap}, coordinates from -1.3 to 1.7, against float64",
            measure=partial(bilinear, wrap), size=256, small=24,
        )
        for wrap in get_args(Wrap)
    ),
    Case(
        name="texture_mean", family=_FAMILY, unit="of the mean", bound=0.02,
        reason="mip levels are bytes: half a code of mid grey is 0.9 % of its light, and two levels are blended",
        scene="Textures of odd sizes, 20,000 times finer than a pixel, against the mean of their light",
        measure=mean_of_fine_texture, size=64, small=4,
    ),
    Case(
        name="texture_coordinates", family=_FAMILY, unit="pixels", bound=0.0,
        reason="whatever a file says, a lookup reads some texel",
        scene="Texture coordinates that are equal, huge, infinite, or not a number", measure=far_texture_coordinates,
        size=128, small=12,
    ),
    *(
        Case(
            name=f"normals_{name}", family=_FAMILY, unit="of the cosine", bound=stretch * SAGITTA / FACING + 1e-5,
            reason=f"a diagonal of {SEGMENTS} segments lies {SAGITTA:.2g} below the sphere: at a cosine of {FACING} "
            f"a ray meets it {SAGITTA / FACING:.2g} beside the place; stretching turns normals {stretch:.2g} times",
            scene=f"A smooth sphere {said}, against the formula", measure=partial(normals, scale), size=512, small=64,
        )
        for name, scale, stretch, said in (
            ("smooth", (1.0, 1.0, 1.0), 1.0, "as it is"),
            ("mirrored", (-1.0, 1.0, 1.0), 1.0, "mirrored"),
            ("stretched", (0.3, 1.0, 2.0), 2.0 / 0.3, "scaled by 0.3, 1 and 2"),
            ("stretched_mirrored", (0.3, -1.0, 2.0), 2.0 / 0.3, "scaled by 0.3, -1 and 2"),
        )
    ),
)  # fmt: skip
