"""The wall rendered whole is its panels put together, pixel for pixel, however the panels are described."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from small_scenes import TracedImage, View, traced_image

from wall.config.loading import Loaded, loads
from wall.config.yaml_text import write
from wall.geometry.cameras import look_at, resolve_view, seen_from
from wall.geometry.expanding import expand, expanded_config
from wall.geometry.panels import Panel, Wall
from wall.scene.build import Scene
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

FINE = 20  # pixels a metre: small walls, few rays


def loaded_of(wall: dict[str, Any], **view: Any) -> Loaded:
    return loads(write({"version": 1, "scene": {"source": "x"}, "wall": wall, "views": [{"id": "main", **view}]}))


def grid(**keys: Any) -> dict[str, Any]:
    return {"grid": {"columns": 2, "rows": 2, "pixels": [16, 12], "size": [0.8, 0.6], **keys}}


def panel(name: str, x: int, y: int, w: int, h: int, **keys: Any) -> dict[str, Any]:
    """By pixels of FINE a metre; (x, y) is the upper left corner, y down."""
    left, right, top, bottom = x / FINE, (x + w) / FINE, -y / FINE, -(y + h) / FINE
    corners = {"lower_left": [left, bottom, 0], "lower_right": [right, bottom, 0], "upper_left": [left, top, 0]}
    return {"id": name, "pixels": [w, h], "corners": corners, **keys}


SIDE = {"left": 0.25, "right": 0.25}
WALLS = {
    "grid": grid(),
    "grid with bezels": grid(bezel=0.07),
    "grid with skipped bezels": {"bezel": "skip", **grid(bezel=0.07)},
    "overlapping grid": grid(overlap=[0.2, 0.13], blend="auto"),
    "turned panels": grid(bezel=0.07, rotation=90),
    "panels one by one": {"panels": [panel("a", 0, 0, 16, 12), panel("b", 18, 0, 10, 20), panel("c", 0, 14, 16, 6)]},
    "overlapping panels": {"panels": [panel("a", 0, 0, 16, 12, overlap=SIDE), panel("b", 11, 2, 16, 12, overlap=SIDE)]},
}
CAMERA = look_at((3.0, 2.2, 4.1), (0.0, 0.6, 0.0), (0.1, 1.0, 0.2))


def drawn(tracer_scene: TracerScene, seen: View, panel: Panel, wall: Wall) -> TracedImage:
    return traced_image(tracer_scene, View(wall=replace(wall, panels=(panel,)), eye=seen.eye, event=seen.event))


def entire(tracer_scene: TracerScene, seen: View, wall: Wall) -> TracedImage:
    """One panel over all of the virtual screen."""
    found = wall.whole()
    assert found is not None
    assert found.plane is wall.panels[0].plane
    return drawn(tracer_scene, seen, replace(wall.panels[0], pixels=(found.width, found.height), screen=(0, 0)), wall)


def view_of(loaded: Loaded, wall: Wall, tiny_view: View) -> View:
    eye = resolve_view(loaded, wall, (0, 0, 0), 1.0).eye
    return View(wall=wall, eye=eye, event=replace(tiny_view.event, camera=CAMERA))


@pytest.mark.parametrize("spelled_out", [False, True], ids=["as it stands", "spelled out"])
@pytest.mark.parametrize("wall_config", WALLS.values(), ids=WALLS.keys())
def test_panels_put_together_are_the_wall_rendered_whole(
    tiny_scene: Scene, tiny_view: View, wall_config: dict[str, Any], spelled_out: bool, compiled_only: None
) -> None:
    loaded, tracer_scene = loaded_of(wall_config), make_tracer_scene(tiny_scene)
    config = loaded.config.wall
    wall = expand(expanded_config(config) if spelled_out else config)
    seen = view_of(loaded, wall, tiny_view)

    together = entire(tracer_scene, seen, wall)

    assert len(np.unique(together.objects)) > 2
    for one in wall.panels:
        part = drawn(tracer_scene, seen, one, wall)
        (x, y), (w, h) = one.screen, one.pixels
        np.testing.assert_array_equal(part.radiance, together.radiance[y : y + h, x : x + w])
        np.testing.assert_array_equal(part.depth, together.depth[y : y + h, x : x + w])
        np.testing.assert_array_equal(part.objects, together.objects[y : y + h, x : x + w])


def test_wall_spelled_out_shows_the_same_objects_in_the_same_pixels(
    tiny_scene: Scene, tiny_view: View, compiled_only: None
) -> None:
    loaded, tracer_scene = loaded_of(grid(bezel=0.0613)), make_tracer_scene(tiny_scene)
    short, spelled = expand(loaded.config.wall), expand(expanded_config(loaded.config.wall))
    seen = view_of(loaded, short, tiny_view)

    one, other = entire(tracer_scene, seen, short), entire(tracer_scene, seen, spelled)

    np.testing.assert_array_equal(one.objects, other.objects)
    np.testing.assert_allclose(one.depth, other.depth, rtol=1e-6)  # float32


def test_denser_panel_beside_a_coarse_one_goes_on_where_that_ends(
    tiny_scene: Scene, tiny_view: View, compiled_only: None
) -> None:
    # every third pixel of a panel three times as fine has its middle where a coarse pixel has it
    coarse, fine = panel("a", 0, 0, 16, 24), panel("b", 16, 0, 16, 24)
    tracer_scene, loaded = make_tracer_scene(tiny_scene), loaded_of({"panels": [coarse, {**fine, "pixels": [48, 72]}]})
    equal = expand(loaded_of({"panels": [coarse, fine]}).config.wall)
    mixed = expand(loaded.config.wall)
    seen = view_of(loaded, mixed, tiny_view)

    together = entire(tracer_scene, replace(seen, wall=equal), equal)

    left, right = (drawn(tracer_scene, seen, one, mixed) for one in mixed.panels)
    np.testing.assert_array_equal(left.objects, together.objects[:, :16])
    np.testing.assert_array_equal(right.objects[1::3, 1::3], together.objects[:, 16:])
    np.testing.assert_allclose(right.depth[1::3, 1::3], together.depth[:, 16:], rtol=1e-6)


def test_eyes_at_one_place_see_what_a_wall_for_one_eye_shows(
    tiny_scene: Scene, tiny_view: View, compiled_only: None
) -> None:
    tracer_scene, loaded = make_tracer_scene(tiny_scene), loaded_of(grid(stereo="top_bottom"), eye_separation=0.0)
    wall, flat = expand(loaded.config.wall), expand(loaded_of(grid(pixels=[16, 6])).config.wall)
    view = resolve_view(loaded, wall, (0, 0, 0), 1.0)
    seen = View(wall=wall, eye=view.eye, event=replace(tiny_view.event, camera=CAMERA))

    for both, one in zip(zip(wall.panels[::2], wall.panels[1::2], strict=True), flat.panels, strict=True):
        expected = drawn(tracer_scene, seen, one, flat)
        for eye in both:
            event = seen_from(seen.event, view.offset(eye))
            part = drawn(tracer_scene, replace(seen, eye=view.eye_of(eye), event=event), eye, wall)
            np.testing.assert_array_equal(part.radiance, expected.radiance)
