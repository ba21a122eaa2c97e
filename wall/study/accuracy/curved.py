"""Curved panels: small spheres on the lines from the eye through points of the screen, found again in their pixels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from wall.config.screens import PanelConfig, WallConfig
from wall.config.views import ViewConfig
from wall.core.data import Event, Float32, Float64, Framelet, Rect
from wall.geometry.cameras import look_at
from wall.geometry.expanding import expand
from wall.geometry.panels import Panel
from wall.geometry.rects import panel_rect
from wall.geometry.seats import Seat, curved_image
from wall.operators.curve import Curve, Positions
from wall.sampling.pixel_means import PixelMeans
from wall.scene.model import Material
from wall.study.accuracy.case import Case, Found, picture
from wall.study.accuracy.scenes import instance, scene_of, sphere_mesh, with_every_feature
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

RADIUS = 3.5  # pixels, of a sphere as the eye sees it
INSET = 9  # pixels from an edge to a sphere's middle
NEAR = 8.5  # pixels around it in which its light is
SPP = 64
CAMERA = look_at((3.0, 2.2, 4.1), (0.0, 0.6, 0.0), (0.1, 1.0, 0.2))
TOLD = (0.21, -0.14, 0.18)  # metres, where a tracker has the eye, from its seat
REACH = 0.3


class Screen(NamedTuple):
    """A curved panel, and the eye before it."""

    name: str
    surface: dict[str, Any]
    eye: tuple[float, float, float]  # metres, wall frame


BENT = {"type": "cylinder", "radius": 2.0, "angles": (-15.0, 45.0), "heights": (-0.6, 0.9)}
ROUND = {"type": "cylinder", "radius": 1.0, "angles": (-25.0, 30.0), "heights": (-0.4, 0.5), "side": "outside"}
TILTED = {"type": "dome", "radius": 3.0, "tilt": 15.0, "azimuths": (-60.0, -10.0), "elevations": (20.0, 60.0)}
SCREENS = (
    Screen("cylinder", BENT, (0.3, 0.2, 0.1)),
    Screen("column", ROUND, (0.5, 0.2, 4.0)),
    Screen("dome", TILTED, (-0.4, 0.3, 0.5)),
)


def curved_panels(width: int) -> Found:
    """Pixels from a sphere to the pixel whose point of the screen is on its line; the worst of all."""
    worst, where, pictures = 0.0, "", []
    for screen in SCREENS:
        for tracked in (False, True):
            panel, view = _placed(screen, (width, width * 3 // 4))
            event = _event(tracked)
            eye = np.array(screen.eye) + np.array(event.camera.eye)
            at = np.array(list(_spots(panel)))
            shown = _shown(panel, view, event, _spheres(panel, eye, event, at))
            for (x, y), off in zip(at, _offsets(shown, at), strict=True):
                if not off <= worst:
                    worst, where = float(off), f"{screen.name}, pixel {x:g}, {y:g}" + ", tracked" * tracked
            if not tracked:
                pictures.append(picture(screen.name, shown))
    return Found(figure=worst, note=where, pictures=tuple(pictures))


def _placed(screen: Screen, pixels: tuple[int, int]) -> tuple[Panel, ViewConfig]:
    config = PanelConfig.model_validate({"id": "p", "pixels": pixels, "surface": screen.surface})
    seat = Seat(np.array(screen.eye), 0.0, REACH)
    wall = expand(WallConfig(panels=(config,)), (seat,))
    return wall.panels[0], ViewConfig(id="main", eye=screen.eye)


def _event(tracked: bool) -> Event:
    camera = CAMERA.tracked(TOLD if tracked else (0.0, 0.0, 0.0), 1.0)
    return Event(view=0, camera_event=0, scene_event=0, scene_time=0.0, input_time=0.0, camera=camera)


def _spots(panel: Panel) -> Iterator[tuple[float, float]]:
    """Positions in panel pixels, centres of pixels: corners, middles of edges, and the middle."""
    w, h = panel.pixels
    for y in (INSET, h // 2, h - 1 - INSET):
        for x in (INSET, w // 2, w - 1 - INSET):
            yield x + 0.5, y + 0.5


def _spheres(panel: Panel, eye: Float64, event: Event, at: Float64) -> Any:
    """A scene of bright spheres behind the panel's points, the farther the later."""
    assert panel.surface is not None
    placed = []
    for k, (x, y) in enumerate(at):
        point = panel.surface.points(np.array([x]), np.array([y]))[0][0, 0]
        away = (1.2 + 0.4 * k) * (point - eye)
        beside = panel.surface.points(np.array([x, x + 1.0]), np.array([y, y + 1.0]))[0] - point
        pitch = min(np.linalg.norm(beside[0, 1]), np.linalg.norm(beside[1, 0]))
        radius = RADIUS * pitch / np.linalg.norm(point - eye) * np.linalg.norm(away)
        x, y, z = (event.camera.origin() + event.camera.rotation() @ away).tolist()
        placed.append(instance(0, at=(x, y, z), scale=float(radius)))
    bright = Material(name="bright", base_color=(0.0, 0.0, 0.0), emission=(1.0, 1.0, 1.0))
    return scene_of([sphere_mesh()], placed, materials=(bright,))


def _shown(panel: Panel, view: ViewConfig, event: Event, scene: Any) -> Float32:
    """(h, w, 3) linear: what the panel shows."""
    rect, eye = panel_rect(panel), np.array(view.eye)
    tracer = Tracer(make_tracer_scene(with_every_feature(scene)), panel, eye, coherent=True)
    tracer.set_event(event)
    means = PixelMeans(Rect(x=0, y=0, width=rect.width, height=rect.height), seed=3)
    for number in range(SPP):
        means.add(tracer.trace(means.positions(number), 0.25, number)[0])
    flat = Framelet.blank(rect, frozenset({"colour"}))
    flat.colour[...], flat.event = means.mean(), event
    shown = Framelet.blank(rect, frozenset({"colour"}))
    Curve(op="curve", id="c", input="p", panel="p").apply([flat], shown, rect, Positions(curved_image(panel, [view])))
    return shown.colour


def _offsets(image: Float32, at: Float64) -> Float64:
    """(n,) pixels from where a sphere should be to the middle of its light; inf where there is none."""
    light = image.mean(axis=2)
    y, x = np.mgrid[: light.shape[0], : light.shape[1]] + 0.5
    found = []
    for spot in at:
        near = (np.hypot(x - spot[0], y - spot[1]) < NEAR) * light
        middle = np.array([(near * x).sum(), (near * y).sum()]) / near.sum() if near.sum() > 0.0 else np.full(2, np.inf)
        found.append(float(np.linalg.norm(middle - spot)))
    return np.array(found)


CASES = (
    Case(
        name="curved_panels", family="Curved panels", unit="pixels", bound=0.1,
        reason="a position in the flat image is rounded to 1/4096 pixel; the middle of a small sphere, of 64 random "
        "samples a pixel, is known to some hundredths",
        scene="Spheres on the lines from an eye off the axis through pixels at corners and edges, of a cylinder from "
        "inside and outside and of a tilted dome; likewise for a tracked eye",
        measure=curved_panels, size=512, small=256,
    ),
)  # fmt: skip
