"""The thin lens: what is in focus stays sharp, what is not becomes discs of the size that geometry says."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scenes import BLACK_SKY, instance, quad, scene_of, view, with_every_feature

from wall.config.loading import load
from wall.core.data import Edits, Float64, Samples
from wall.core.errors import ConfigError
from wall.geometry.lens import Lens
from wall.roles.plan import make_layout, make_plan
from wall.scene.model import Material
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

EDGE = 64  # pixels
SEEN = view(
    (0.0, 0.0, 10.0), (0.0, 0.0, 0.0), pixels=(EDGE, EDGE), fov=math.degrees(2 * math.atan(0.1))
)  # 2 units at z 0
LENS = Lens(radius=0.05, focus=3.0)  # as configured; every test edits it
SHINING = Material(name="lamp", base_color=(0.0, 0.0, 0.0), emission=(1.0, 1.0, 1.0))


def samples_of(z: float, edge: float, lens: Lens | None, sweeps: int, step: int = 1) -> list[Samples]:
    """Sweeps over every step-th pixel of a shining square of an edge, at a place on the axis."""
    scene = replace(
        scene_of([quad(edge, edge)], [instance(0, at=(0.0, 0.0, z))], materials=[SHINING], sky=BLACK_SKY), path_depth=1
    )
    scene = replace(with_every_feature(scene), lens=LENS if lens else None)
    tracer = Tracer(make_tracer_scene(scene), SEEN.panel, SEEN.eye, coherent=False)
    edits = {} if lens is None else {"lens.aperture": (lens.aperture,), "lens.focus": (lens.focus,)}
    tracer.set_event(replace(SEEN.event, edits=Edits(1, tuple(edits.items()))))
    xy = (
        np.stack(np.meshgrid(np.arange(0, EDGE, step) + 0.4, np.arange(0, EDGE, step) + 0.6), axis=-1)
        .reshape(-1, 2)
        .astype(np.float32)
    )
    return [tracer.trace(xy, 0.0, number)[0] for number in range(sweeps)]


def image(z: float, edge: float, lens: Lens | None, sweeps: int) -> Float64:
    found = np.mean([samples["radiance"][:, 0] for samples in samples_of(z, edge, lens, sweeps)], axis=0)
    return np.asarray(found, np.float64).reshape(EDGE, EDGE)


@pytest.mark.usefixtures("compiled_only")
def test_what_is_in_focus_is_sharp() -> None:
    """A square in the plane of focus is its pinhole image, path by path."""
    lens = Lens(radius=0.3, focus=10.0)
    np.testing.assert_array_equal(image(0.0, 1.01, lens, 4), image(0.0, 1.01, None, 4))


@pytest.mark.usefixtures("compiled_only")
@pytest.mark.parametrize(("z", "focus"), [(0.0, 20.0), (0.0, 7.0), (-10.0, 10.0)])
def test_a_point_out_of_focus_is_an_even_disc(z: float, focus: float) -> None:
    """At distance d the rays of one pixel meet a disc of radius R |d - f| / f. So a small square of area a shows as a
    disc of that radius, in which each pixel sees it in a share a / (pi r^2) of its rays."""
    lens, edge, distance = Lens(radius=1.0, focus=focus), 0.06, 10.0 - z
    found = image(z, edge, lens, 512)
    radius = lens.radius * abs(distance - focus) / focus
    pixel = 0.2 * distance / EDGE
    place = (np.arange(EDGE) + 0.5 - EDGE / 2) * pixel
    away = np.hypot(*np.meshgrid(place, place))
    inside, outside = away < radius - pixel - edge, away > radius + pixel + edge
    assert inside.sum() > 50
    np.testing.assert_allclose(found[inside].mean(), edge**2 / (math.pi * radius**2), rtol=0.05)
    assert found[outside].max() == 0.0


def test_a_lens_that_is_closed_is_a_pinhole(compiled_only: None) -> None:
    """Aperture 0: the light is that without a lens, whatever is in focus."""
    closed = image(-10.0, 1.01, Lens(radius=0.0, focus=7.0), 1)
    np.testing.assert_allclose(closed, image(-10.0, 1.01, None, 1), atol=1e-6)
    assert 0.0 < closed.mean() < 1.0


def test_depth_is_the_distance_from_the_eye() -> None:
    """Rays that start beside the eye: samples are reprojected from the eye."""
    (samples,) = samples_of(0.0, 50.0, Lens(radius=0.3, focus=4.0), 1, step=8)
    depth = samples["depth"]
    np.testing.assert_allclose(depth, 10.0, rtol=0.02)
    assert float(np.ptp(depth)) > 0.01


def test_a_lens_under_direct_light_is_refused(tmp_path: Path) -> None:
    text = """\
version: 1
scene: {source: gallery}
wall: {grid: {columns: 1, rows: 1, pixels: [40, 30], size: [0.4, 0.3]}}
views: [{lens: {aperture: 0.1, focus: 3}}]
"""
    (tmp_path / "lens.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"views\[0\].lens.*direct light has no lens; accepted: scene.integrator"):
        make_plan(make_layout(load(tmp_path / "lens.yaml")))
