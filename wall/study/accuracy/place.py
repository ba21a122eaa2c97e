"""Scenes far from the origin, very large and very small, and both at once."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_codes
from wall.core.data import Float64
from wall.scene.build import Scene
from wall.scene.model import DirectionalLight
from wall.study.accuracy.case import Case, Found, difference, picture
from wall.study.accuracy.scenes import (
    TracedImage,
    Triple,
    View,
    instance,
    moved_scene,
    scene_of,
    sphere_mesh,
    tiny_scene,
    traced_image,
    view,
)

EYE: Triple = (0.0, 2.2, 5.0)


def moved_with_its_camera(by: Triple, width: int) -> Found:
    """Share of the pixels whose code or object differs after scene, lights and camera were moved together."""
    seen = _seen(width)
    scene = tiny_scene()
    here, there = traced_image(scene, seen), traced_image(moved_scene(scene, by), _from(seen, np.add(EYE, by)))
    return _compared(here, there, "moved")


def scaled(factor: float, width: int) -> Found:
    """The same after scene, camera and the distances of lights were scaled; point lights by the square."""
    seen = _seen(width)
    here = traced_image(tiny_scene(), seen)
    there = traced_image(_scaled_scene(tiny_scene(), factor), _from(seen, np.multiply(EYE, factor)))
    return _compared(here, there, f"scaled by {factor:g}")


def sizes_together(width: int) -> Found:
    """The same of balls of 1e-6, 1 and 1e6 in one scene, each seen from 3 radii, against the ball of 1 alone."""
    sizes, ball = (1e-6, 1.0, 1e6), sphere_mesh(segments=48)
    centres: dict[float, Triple] = {1e-6: (1.5, 0.0, 0.0), 1.0: (0.0, 0.0, 0.0), 1e6: (0.0, -3e6, 0.0)}
    light = DirectionalLight(direction=(0.48, 0.64, 0.6), irradiance=(2.0, 1.9, 1.7))
    together = scene_of([ball], [instance(0, at=centres[size], scale=size) for size in sizes], lights=[light])
    seen = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(width, width))
    alone = traced_image(scene_of([ball], lights=[light]), seen)
    found = []
    for size in sizes:
        image = traced_image(together, _from(seen, np.add(centres[size], (0.0, 0.0, 3.0 * size))))
        same = replace(image, objects=(image.objects > 0).astype(np.uint32))
        found.append(_compared(alone, same, f"size {size:g}"))
    worst = max(found, key=lambda f: f.figure)
    return replace(worst, pictures=(found[0].pictures[0], *(f.pictures[1] for f in found)))


def _seen(width: int) -> View:
    return view(EYE, (0.0, 0.6, 0.0), pixels=(width, width * 3 // 4))


def _from(seen: View, position: Float64) -> View:
    x, y, z = position.tolist()
    return replace(seen, event=replace(seen.event, camera=replace(seen.event.camera, position=(x, y, z))))


def _scaled_scene(scene: Scene, factor: float) -> Scene:
    matrix = np.diag([factor] * 3 + [1.0])
    points = [
        replace(
            p, position=tuple(np.multiply(p.position, factor)), intensity=tuple(np.multiply(p.intensity, factor**2))
        )
        for p in scene.point_lights
    ]
    placed = [replace(i, world_from_object=matrix @ i.world_from_object) for i in scene.instances]
    return scene_of(
        scene.meshes, placed, materials=scene.materials, sky=scene.sky, lights=[*points, *scene.directional_lights]
    )


def _times(values: Triple, factor: float) -> Triple:
    x, y, z = values
    return x * factor, y * factor, z * factor


def _compared(here: TracedImage, there: TracedImage, title: str) -> Found:
    wrong = differing(here, there)
    return Found(
        figure=float(wrong.mean()), note=f"{int(wrong.sum())} of {wrong.size} pixels",
        pictures=(
            picture("as it is", here.radiance), picture(title, there.radiance),
            difference("difference", here.radiance, there.radiance),
        ),
    )  # fmt: skip


def differing(here: TracedImage, there: TracedImage) -> NDArray[np.bool_]:
    """(h, w) pixels whose 8-bit code or object differs."""
    codes = srgb_codes(here.radiance) != srgb_codes(there.radiance)
    wrong: NDArray[np.bool_] = codes.any(axis=-1) | (here.objects != there.objects)
    return wrong


_MOVED: tuple[tuple[Triple, str, float, str], ...] = (
    ((1e3, -1e3, 1e3), "1e3", 0.0, "float64 places are exact to 1e-13 units there"),
    ((1e6, -1e6, 1e6), "1e6", 0.0, "float64 places are exact to 1.2e-10 units there, far below a float32 rounding"),
    ((1e8, 1e8, -1e8), "1e8", 1e-3, "float64 places are exact to 1.5e-8 units there, a millionth of a pixel"),
    ((2.0**40, 0.0, 0.0), "1e12", 1e-2, "float64 places are exact to 1.2e-4 units there, a hundredth of a pixel"),
)
_SHARE = "share of pixels"
CASES = tuple(
    Case(
        name=f"far_origin_{name}", family="Place and scale", unit=_SHARE, bound=bound, reason=reason,
        scene=f"A floor and two balls, moved {name} units from the origin with their camera and lights",
        measure=partial(moved_with_its_camera, by), size=512, small=128,
    )
    for by, name, bound, reason in _MOVED
) + tuple(
    Case(
        name=f"scale_{factor:.0e}", family="Place and scale", unit=_SHARE, bound=1e-3,
        reason="the factor is no power of two, so every float32 is rounded anew: a code differs where light is within "
        "some 1e-6 of the border between two codes, an object where a ray is within 1e-6 of an edge",
        scene=f"The same, all lengths times {factor:g}", measure=partial(scaled, factor), size=512, small=96,
    )
    for factor in (1e-6, 1e-3, 1e3, 1e6)
) + (
    Case(
        name="sizes_together", family="Place and scale", unit=_SHARE, bound=1e-3,
        reason="as above: each object is traced in its own units, so the others do not cost it digits",
        scene="Balls of 1e-6, 1 and 1e6 units in one scene, each seen from three radii, against the one of 1 alone",
        measure=sizes_together, size=256, small=48,
    ),
)  # fmt: skip
