"""Light that must neither grow nor vanish: furnaces, close lamps, the shadow terminator, stored light that moves."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from wall.core.data import SAMPLE, Event, Float32, Float64, Samples
from wall.geometry.cameras import look_at
from wall.reconstruction.reconstruction import Ingredients, Reconstruction
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight, Material, Sky
from wall.study.accuracy.case import Case, Found, picture
from wall.study.accuracy.scenes import (
    BLACK_SKY,
    View,
    directions,
    instance,
    material,
    quad,
    scene_of,
    sphere_mesh,
    traced_image,
    view,
    with_every_feature,
)
from wall.tracing.kernels.mirrors import MAX_BOUNCES
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

WHITE_SKY = Sky(zenith=(1.0, 1.0, 1.0), horizon=(1.0, 1.0, 1.0), ground=(1.0, 1.0, 1.0))
EDGE = 64  # pixels of views all of whose pixels show the same
GREY = 0.6  # albedo of the closed room
DEPTH = 5  # surfaces of a path in it
MIRRORED = 0.7  # of light, by two mirrors that face each other
CLOSEST, RADIANCE = 1e-4, 1e7  # of a lamp above a floor
LAMP = 0.01  # its edge
TERMINATOR = 0.02  # cosine from which on a smooth normal counts as lit
REFRESH_S = 1.0 / 60.0


def furnace(width: int) -> Found:
    """Largest relative error of a white sphere under a white sky of radiance 1."""
    scene = with_every_feature(scene_of([sphere_mesh()], materials=[material(1.0, 1.0, 1.0)], sky=WHITE_SKY))
    got = traced_image(scene, view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(width, width)))
    error = float(np.abs(got.radiance.astype(np.float64) - 1.0).max())
    return Found(figure=error)


def parallel_mirrors(width: int) -> Found:
    """Largest relative error of what two mirrors that face each other show, against the sum of their series.

    Each shines with radiance 1 besides, and mirrors MIRRORED. Chains end behind MAX_BOUNCES mirrors.
    """
    glass = Material(name="glass", base_color=(0.0,) * 3, emission=(1.0,) * 3, mirror=MIRRORED)
    placed = [instance(0, at=(0.0, 0.0, -1.0)), instance(0, at=(0.0, 0.0, 1.0), turn=("y", 180.0))]
    scene = with_every_feature(scene_of([quad(1e3, 1e3)], placed, materials=[glass], sky=BLACK_SKY))
    got = traced_image(scene, view((0.0, 0.0, 0.3), (0.4, 0.2, -1.0), pixels=(width, width)))
    series = 1.0 - MIRRORED ** (MAX_BOUNCES + 1)  # each mirror adds (1 - m) of its own light to m of what it shows
    error = float(np.abs(got.radiance.astype(np.float64) / series - 1.0).max())
    return Found(figure=error, note=f"{MIRRORED ** (MAX_BOUNCES + 1):.2g} of the light is behind the last mirror")


def closed_room(sweeps: int) -> Found:
    """Relative error of the mean radiance in a closed sphere of radiance 1 and albedo GREY."""
    walls = Material(name="walls", base_color=(GREY,) * 3, emission=(1.0, 1.0, 1.0))
    scene = replace(scene_of([sphere_mesh(segments=16, smooth=False)], materials=[walls]), path_depth=DEPTH)
    got = _mean(scene, view((0.1, 0.2, 0.3), (0.0, 0.0, -1.0), pixels=(EDGE, EDGE)), sweeps)
    series = (1.0 - GREY ** (DEPTH + 1)) / (1.0 - GREY)
    return Found(figure=float(np.abs(got / series - 1.0).max()), note=f"{sweeps * EDGE**2:,} paths")


def close_lamp(sweeps: int) -> Found:
    """Relative error of a floor's radiance under the middle of a lamp CLOSEST above it, against its form factor."""
    x = LAMP / 2 / CLOSEST
    quarter = x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / math.pi
    floor = Material(name="floor", base_color=(0.5,) * 3)
    lamp = Material(name="lamp", base_color=(0.0,) * 3, emission=(RADIANCE,) * 3, emits_behind=False)
    placed = [instance(0, turn=("x", -90.0)), instance(1, at=(0.0, CLOSEST, 0.0), turn=("x", 90.0))]
    scene = replace(
        scene_of([quad(1.0, 1.0), quad(LAMP, LAMP, material=1)], placed, materials=[floor, lamp]), path_depth=1
    )
    seen = view((0.0, CLOSEST / 2, 0.02), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=0.01)
    got = _mean(scene, seen, sweeps)
    return Found(figure=float(np.abs(got / (0.5 * 4 * quarter * RADIANCE) - 1.0).max()), note=f"mean {got[0]:.4g}")


def _mean(scene: Scene, seen: View, sweeps: int) -> Float64:
    """(3,) mean radiance of so many samples of every pixel."""
    tracer = Tracer(make_tracer_scene(with_every_feature(scene)), seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    xy = _centres(seen)
    sums = [tracer.trace(xy, 0.0, k)[0]["radiance"].astype(np.float64).mean(axis=0) for k in range(sweeps)]
    return np.asarray(np.mean(sums, axis=0), np.float64)


def terminator(segments: int, width: int) -> Found:
    """Share of the pixels of a smooth sphere that its round normal lights, but that are black."""
    light = (0.8, 0.36, 0.48)
    sun = DirectionalLight(direction=light, irradiance=(math.pi,) * 3)
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(width, width), fov=30.0)
    got = traced_image(with_every_feature(scene_of([sphere_mesh(segments=segments)], lights=[sun])), seen)
    points = np.array([0.0, 0.0, 4.0]) + directions(seen) * np.where(got.objects == 1, got.depth, 0.0)[..., None]
    cosine = points @ np.array(light) / np.linalg.norm(points, axis=2)
    lit = (got.objects == 1) & (cosine > TERMINATOR)
    black = lit & (got.radiance[..., 0] == 0.0)
    marked = got.radiance.copy()
    marked[black] = (1.0, 0.0, 0.0)
    return Found(
        figure=float(black.sum() / lit.sum()), note=f"{int(black.sum())} of {int(lit.sum()):,} pixels",
        pictures=(picture("as it is", got.radiance), picture("wrongly black in red", marked)),
    )  # fmt: skip


def filter_weights(samples: int) -> Found:
    """Largest relative error of an image of one light, reconstructed from samples at random positions."""
    image, seen = _image()
    width, height = seen.panel.pixels
    random = np.random.default_rng(15)
    for k in range(4):
        xy = (random.random((samples, 2)) * (width, height)).astype(np.float32)
        xy = np.minimum(xy, np.nextafter(np.array([width, height], np.float32), np.float32(0)))
        event = _moved(seen, k, 0.01 * k)  # at rest a pixel would show its own samples' mean
        image.insert(_hits(np.concatenate([_centres(seen), xy])), k * REFRESH_S, event)
        image.refresh(event, (k + 1) * REFRESH_S)
    shown = image.radiance
    return Found(figure=_off(shown), note=f"{4 * samples:,} samples")


def stored_light(moves: int) -> Found:
    """Largest relative error of stored light after the camera went to and fro so often, and stands where it began."""
    image, seen = _image()
    image.insert(_hits(_centres(seen)), 0.0, _moved(seen, 0))
    image.refresh(_moved(seen, 0), REFRESH_S)
    for k in range(1, moves + 1):
        away = 0.0 if k == moves else 0.5 * math.sin(k)
        image.refresh(_moved(seen, k, away), (k + 1) * REFRESH_S)
    return Found(figure=_off(image.radiance), note=f"{moves} moves")


LIGHT = (0.3, 0.55, 0.7)  # of the samples below


def _image() -> tuple[Reconstruction, View]:
    """Of a wall that fills the view, 4 units before the eye."""
    glowing = Material(name="glowing", base_color=(0.0,) * 3, emission=LIGHT)
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(48, 32))
    scene = scene_of([quad(40.0, 40.0)], materials=[glowing])
    return Reconstruction(seen.panel, seen.eye, scene, detects_change=False, ingredients=Ingredients(parts=False)), seen


def _moved(seen: View, number: int, away: float = 0.0) -> Event:
    camera = look_at((away, 0.0, 4.0), (away, 0.0, 0.0), (0.0, 1.0, 0.0))
    return replace(seen.event, camera_event=number, input_time=number * REFRESH_S, camera=camera)


def _hits(xy: Float32) -> Samples:
    """Of the wall, at a depth that is right in the view that `_moved` begins with."""
    samples = np.zeros(len(xy), SAMPLE)
    samples["xy"], samples["radiance"], samples["object_id"] = xy, LIGHT, 1
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(48, 32))
    height = 2.0 * math.tan(math.radians(22.5)) / 32
    x, y = (xy[:, 0] - 24) * height, (xy[:, 1] - 16) * height
    samples["depth"] = float(np.linalg.norm(seen.event.camera.origin())) * np.sqrt(1.0 + x**2 + y**2)
    return samples


def _centres(seen: View) -> Float32:
    """(n, 2) float32, row by row."""
    width, height = seen.panel.pixels
    return (
        np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
        .reshape(-1, 2)
        .astype(np.float32)
    )


def _off(shown: Float32) -> float:
    return float(np.abs(shown.astype(np.float64) / np.array(LIGHT) - 1.0).max())


CASES = (
    Case(
        name="furnace", family="Light", unit="of the sky", bound=32 * 2.0**-24,
        reason="the irradiance of a constant sky is a table's value, whatever the normal: some 32 roundings in all",
        scene="A white sphere under a white sky shows the sky's radiance", measure=furnace, size=512, small=24,
    ),
    Case(
        name="closed_room", family="Light", unit="of the series", bound=0.005,
        reason="every path adds 1 + a + a^2 ..., only whether lamps are aimed at or met is by chance: the standard "
        "error of 65,536 paths is below 0.001",
        scene=f"The inside of a sphere of radiance 1 and albedo {GREY}, paths of {DEPTH} surfaces",
        measure=closed_room, size=64, small=8, long=1024,
    ),
    Case(
        name="close_lamp", family="Light", unit="of the form factor's light", bound=0.01,
        reason="the floor sees nothing but the lamp; a standard error is 0.002; a light of 1e7 must not be "
        "clamped as a firefly, and the ray offset must not reach the lamp",
        scene=f"A lamp of {LAMP:g} x {LAMP:g} and radiance 1e7, {CLOSEST:g} above a floor, whose middle is seen",
        measure=close_lamp, size=64, small=8, long=1024,
    ),
    *(
        Case(
            name=f"terminator_{segments}", family="Light", unit="share of lit pixels", bound=0.0,
            reason="a pixel that the smooth normal lights may be darker, but not black: that shows the triangles",
            scene=f"A smooth sphere of {segments} segments under a directional light, seen from the side",
            measure=partial(terminator, segments), size=512, small=64,
        )
        for segments in (12, 24, 48)
    ),
    Case(
        name="parallel_mirrors", family="Light", unit="of the light", bound=64 * 2.0**-24,
        reason=f"{MAX_BOUNCES} mirrors are followed, two products and a sum each; what is behind the last one is left "
        "out on purpose",
        scene="Two mirrors that face each other, and shine, seen from between them", measure=parallel_mirrors, size=64,
        small=8,
    ),
    Case(
        name="filter_weights", family="Light", unit="of the light", bound=64 * 2.0**-24,
        reason="a mean of equal values is that value: a pixel sums some 20 products in float32 and divides once",
        scene="A wall of one light, reconstructed from samples at random positions while the camera moves",
        measure=filter_weights, size=6000, small=1000,
    ),
    Case(
        name="stored_light", family="Light", unit="of the light", bound=64 * 2.0**-24,
        reason="samples are reprojected from where they were hit, not from where they were last: nothing adds up",
        scene="The same, stored once; then the camera moves to and fro, and stands where it began",
        measure=stored_light, size=1000, small=40, long=20_000,
    ),
)  # fmt: skip
