"""The experiment's adaptive method makes its image as a renderer does: of fewer pixels and samples where it is late."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from wall.config.loading import loads
from wall.reconstruction.dynamic_resolution import DynamicResolution
from wall.roles.plan import make_layout, make_plan
from wall.roles.resolution import FIRST
from wall.study.quality.method import Setup
from wall.study.quality.methods_adaptive import METHODS, AdaptiveMethod
from wall.tracing.tracer_scene import make_tracer_scene

REFRESH_HZ = 30.0


def setup_of(width: int, height: int) -> Setup:
    text = f"""version: 1
scene: {{source: gallery}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [{width}, {height}], size: [0.4, 0.3]}}}}
views: [{{camera: auto, path: {{type: orbit, period_s: 8}}, refresh_hz: {REFRESH_HZ:g}}}]
"""
    plan = make_plan(make_layout(loads(text)))
    return Setup(plan=plan, tracer_scene=make_tracer_scene(plan.scene), rate=20_000.0, refresh_hz=REFRESH_HZ, seed=1)


def scale_of(method: AdaptiveMethod) -> int:
    image = method._image._image
    return image.scale if isinstance(image, DynamicResolution) else 1


def test_a_small_image_is_made_of_all_pixels_and_has_the_same_bits_as_the_full_one(compiled_only: None) -> None:
    setup = setup_of(160, 120)
    ours, full = METHODS["adaptive"](setup), METHODS["adaptive:full"](setup)
    for k in range(1, 5):
        for method in (ours, full):
            method.advance(k / REFRESH_HZ)
        assert_array_equal(ours.show(k / REFRESH_HZ), full.show(k / REFRESH_HZ))
    assert ours.rays == full.rays > 0


def test_a_large_image_begins_with_fewer_pixels_and_is_shown_in_the_size_of_the_panel(compiled_only: None) -> None:
    setup = setup_of(600, 480)
    assert FIRST < 600 * 480
    ours = METHODS["adaptive"](setup)
    ours.advance(1 / REFRESH_HZ)
    shown = ours.show(1 / REFRESH_HZ)
    assert isinstance(ours, AdaptiveMethod)
    assert scale_of(ours) == 2
    assert shown.shape == (480, 600, 3)
    assert np.isfinite(shown).all()


@pytest.mark.parametrize(("every", "fewer"), [(1, False), (3, True)])
def test_a_method_that_is_shown_late_keeps_fewer_samples(compiled_only: None, every: int, fewer: bool) -> None:
    method = METHODS["adaptive"](setup_of(64, 48))
    assert isinstance(method, AdaptiveMethod)
    for k in range(every, 40, every):
        method.advance(k / REFRESH_HZ)
        method.show(k / REFRESH_HZ)
    assert (method._image._budget.share < 1.0) == fewer
