"""Samples that saw the scene before an edit lose confidence, never all of it; the kernel and its NumPy twin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from small_scenes import quad, scene_of

from wall.deepbuffer.kernels.doubt import FRESH, KEPT, LEAST, doubt
from wall.deepbuffer.shading import ShadingChanges
from wall.deepbuffer.store import SampleStore
from wall.geometry.lens import Lens
from wall.scene.build import Scene
from wall.scene.model import AmbientOcclusion, DirectionalLight, Material, Shading

SUN = DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(1.0, 1.0, 1.0))
NONE, ALL = np.zeros(4, np.bool_), np.array([False, True, True, True])


@pytest.mark.parametrize("unlit", [False, True])
def test_the_kernel_is_its_twin(unlit: bool) -> None:
    random = np.random.default_rng(3)
    store = SampleStore.of(200, lit=True)
    store.object_id[:] = random.integers(0, 4, 200)
    store.confidence[:] = random.choice(np.float32([0.0, 0.1, 0.3, 0.6, 1.0, FRESH]), 200)
    store.albedo[0] = random.choice(np.float32([-1.0, 0.5]), 200)
    doubted, before = np.uint8([0, 1, 0, 1]), store.confidence.copy()
    own = (doubted[store.object_id] != 0) | (unlit & (store.object_id != 0) & (store.albedo[0] < 0))
    wanted = np.where(own & (before > LEAST), np.maximum(before * KEPT, LEAST), before)
    wanted = np.where(before > 1.0, 1.0, wanted)
    wanted[:20] = before[:20]
    assert doubt(store, 20, 200, doubted, unlit) == (wanted < np.minimum(before, 1.0)).sum()
    assert_allclose(store.confidence, wanted)


def test_edit_after_edit_a_sample_stays() -> None:
    store = SampleStore.of(1, lit=False)
    store.confidence[0] = 1.0
    for _ in range(100):
        doubt(store, 0, 1, np.uint8([1]), False)
    assert store.confidence[0] == LEAST > 0


def test_of_an_empty_store_nothing_is_doubted() -> None:
    assert doubt(SampleStore.of(0, lit=False), 0, 0, np.uint8([1]), False) == 0


def scene(depth: int | None = None) -> Scene:
    """A matt, a mirroring and a red quad under the sun."""
    materials = (Material(name="matt"), Material(name="mirror", mirror=0.5), Material(name="red"))
    made = scene_of([quad(1, 1, material=k) for k in range(3)], materials=materials, lights=(SUN,))
    return replace(made, path_depth=depth)


def changes(before: Scene, *, relit: np.ndarray = NONE, **new: object) -> list[int] | None:
    was = before.shading(0.0)
    now: Shading = replace(was, **new)  # type: ignore[arg-type]
    found = ShadingChanges(before).between(now, was, relit)
    return None if found is None else found.tolist()


def test_a_light_s_edit_doubts_what_is_not_lit_anew() -> None:
    brighter = (replace(SUN, irradiance=(2.0, 2.0, 2.0)),)
    assert changes(scene(), directional_lights=brighter) == [0, 1, 1, 1]
    assert changes(scene(), directional_lights=brighter, relit=np.array([False, True, False, True])) == [0, 0, 1, 0]


def test_ambient_occlusion_follows_no_light() -> None:
    shape = replace(scene(), path_depth=1, occlusion=AmbientOcclusion(distance=3.0))
    assert changes(shape, directional_lights=(replace(SUN, irradiance=(2.0, 2.0, 2.0)),)) is None
    assert changes(shape, occlusion_distance=2.0) == [1, 1, 1, 1]


def test_a_light_that_is_moved_may_shade_anything() -> None:
    moved = (replace(SUN, direction=(0.0, 1.0, 0.0)),)
    assert changes(scene(), directional_lights=moved, relit=ALL) == [0, 1, 1, 1]


def test_a_material_s_edit_doubts_its_objects_and_mirrors() -> None:
    was = scene().materials
    assert changes(scene(), materials=(*was[:2], replace(was[2], base_color=(1.0, 0.0, 0.0)))) == [0, 0, 1, 1]


def test_the_sky_s_edit_doubts_the_background() -> None:
    assert changes(scene(), sky=replace(scene().sky, zenith=(1.0, 1.0, 1.0)), relit=ALL) == [1, 0, 0, 0]
    assert changes(scene(), environment_strength=2.0) == [1, 1, 1, 1]


def test_on_paths_every_edit_doubts_everything_and_equal_shadings_nothing() -> None:
    assert changes(scene(depth=4), path_depth=2) == [1, 1, 1, 1]
    through = Lens(radius=0.1, focus=3.0)
    assert changes(scene(depth=4), lens=through) == [1, 1, 1, 1]
    assert changes(replace(scene(depth=4), lens=through), lens=replace(through, focus=3.0)) is None
    assert changes(scene(depth=1), occlusion_distance=3.0) == [1, 1, 1, 1]
    assert changes(scene(depth=4)) is None
    assert_array_equal(changes(scene(), materials=tuple(replace(m) for m in scene().materials)), None)
