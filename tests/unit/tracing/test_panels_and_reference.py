"""A wall in parts is the wall as a whole, bit for bit; a converged image does not depend on who rendered it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_scenes import traced_image, view

from wall.commands import offline
from wall.commands.render import render
from wall.config.loading import load
from wall.core.data import Float32
from wall.roles.plan import make_layout, make_plan
from wall.scene.build import Scene


def test_coherent_and_incoherent_traversal_see_the_same(tiny_scene: Scene) -> None:
    seen = view((0.0, 2.2, 5.0), (0.0, 0.6, 0.0), pixels=(20, 16))
    one, other = (traced_image(tiny_scene, seen, coherent=c) for c in (True, False))
    np.testing.assert_array_equal(one.radiance, other.radiance)
    np.testing.assert_array_equal(one.objects, other.objects)


CONFIG = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [24, 20], size: [0.6, 0.5], bezel: 0.01}}
views: [{id: main}]
"""


def rendered(path: Path, *, seed: int = 3) -> Float32:
    plan = make_plan(make_layout(load(path)))
    drawn = render(plan, spp=2, seed=seed, size=(45, 37), at=0.5)
    assert drawn is not None
    return drawn


def test_converged_image_has_the_same_bits_for_any_number_of_threads_and_any_bands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    config = tmp_path / "wall.yaml"
    config.write_text(CONFIG)
    images = []
    for threads, rows in ((1, 16), (3, 16), (2, 5), (1, 64)):
        monkeypatch.setattr(offline.os, "sched_getaffinity", lambda _, n=threads: set(range(n)))
        monkeypatch.setattr(offline, "BAND_ROWS", rows)
        images.append(rendered(config))
    assert images[0].shape == (37, 45, 3)
    assert images[0].any()
    for other in images[1:]:
        np.testing.assert_array_equal(images[0], other)
    assert (images[0] != rendered(config, seed=4)).any()
