"""Adaptive sampling of a still view: it ends, soon enough, and then shows what `wall render` shows."""

from __future__ import annotations

import math
import tempfile
from functools import cache, partial
from pathlib import Path

import numpy as np

from wall.commands.render import render
from wall.config.loading import load
from wall.core.colour import srgb_codes
from wall.core.data import Float64
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.study.accuracy.case import Case, Found, Picture, picture
from wall.study.accuracy.scenes import turned
from wall.tracing.tracer_scene import make_tracer_scene

CONFIG = """\
version: 1
scene:
  source: square.obj
  animation: []
  sky: {{zenith: [0.2, 0.2, 0.2], horizon: [0.2, 0.2, 0.2], ground: [0.2, 0.2, 0.2]}}
  materials: [{{object: "*", type: emission, radiance: [{radiance}, {radiance}, {radiance}]}}]
wall: {{grid: {{columns: 1, rows: 1, pixels: [{edge}, {edge}], size: [20, 20]}}}}
views: [{{camera: {{position: {position}, target: {target}, up: {up}}}, eye: [0, 0, {eye}], refresh_hz: 30}}]
sampling: {{method: adaptive, samples_per_pixel: 2, samples_per_batch: 64}}
"""
SQUARE = np.array([[-0.9, -0.5, 0.0], [0.6, -0.7, 0.0], [0.8, 0.5, 0.0], [-0.6, 0.8, 0.0]])
TURN = turned("x", 31.0) @ turned("y", 17.0)  # of all: positions round in every direction
EYE = 10.0 / math.tan(math.radians(20.0))  # metres before a panel of 20 m: a field of view of 40 degrees
AWAY = 3.0 / EYE  # of the square, times the eye's distance
REFERENCE_SPP = 16_384
AT_MOST = 8.0  # times the samples of uniform sampling
GIVEN_UP = 16_384  # samples a pixel without being complete
QUIET = 200  # batches without a sample: longer than any wait for a refresh
WRONG = 5  # codes
SMALL = {1.0: 6}  # pixels an edge in the test command, by radiance: the others take longer


@cache
def lamp(edge: int, radiance: float, eye: float) -> Plan:
    """A square of a radiance before a sky of 0.2, from an eye so far before the panel, metres: always one picture."""
    places = np.array([[0.13, 0.07, AWAY * eye], [0.13, 0.07, 0.0], [0.0, 1.0, 0.0]]) @ TURN.T
    position, target, up = places.tolist()
    vertices = [f"v {x!r} {y!r} {z!r}" for x, y, z in (SQUARE @ TURN.T).tolist()]
    text = CONFIG.format(edge=edge, radiance=radiance, eye=eye, position=position, target=target, up=up)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "square.obj").write_text("\n".join(["o lamp", *vertices, "f 1 2 3 4", ""]), encoding="utf-8")
        path = Path(folder) / "wall.yaml"
        path.write_text(text, encoding="utf-8")
        return make_plan(make_layout(load(path)))


def _rendered(plan: Plan, spp: int, seed: int) -> Float64:
    """(h, w, 3) linear."""
    image = render(plan, spp=spp, seed=seed, at=0.0)
    assert image is not None
    return image.astype(np.float64)


@cache
def _ended(radiance: float, eye: float, edge: int) -> tuple[Found, Found]:
    """How soon it ends, over uniform sampling; and the share of pixels that are wrong then."""
    plan = lamp(edge, radiance, eye)
    reference = _rendered(plan, REFERENCE_SPP, 7)
    codes = srgb_codes(reference).astype(float)
    wall, quiet = SingleProcess(plan, make_tracer_scene(plan.scene)), 0
    spent, most = 0, GIVEN_UP * edge**2
    while quiet < QUIET and spent < most:
        traced = wall.step()
        spent, quiet = spent + traced, 0 if traced else quiet + 1
    (image,) = wall.composition.shown()[0].images()
    shown = image.rgb.astype(float)
    wrong = (np.abs(shown - codes) > WRONG).any(axis=2)
    ended = quiet >= QUIET
    error, needed = _rmse(shown, codes), 1
    while needed < REFERENCE_SPP and _rmse(srgb_codes(_rendered(plan, needed, 3)), codes) > error:
        needed *= 2
    ratio = spent / (needed * edge**2)
    words = "complete" if ended else "given up, not complete"
    note = f"{spent / edge**2:,.0f} samples a pixel, {words}, RMSE {error:.2f} codes; uniform sampling needs {needed:,}"
    pictures = (
        Picture(title="shown", rgb=np.asarray(image.rgb).copy()), picture("reference", reference),
        picture("off by more than 5 codes", wrong),
    )  # fmt: skip
    off = Found(figure=float(wrong.mean()), note=f"RMSE {error:.2f} codes, {words}", pictures=pictures)
    return Found(figure=ratio if ended or ratio > AT_MOST else math.inf, note=note), off


def _rmse(a: np.ndarray, b: np.ndarray) -> float:
    return math.sqrt(float(((a.astype(float) - b) ** 2).mean()))


def soon(radiance: float, eye: float, edge: int) -> Found:
    """Samples until it is complete, over those that uniform sampling needs."""
    return _ended(radiance, eye, edge)[0]


def right(radiance: float, eye: float, edge: int) -> Found:
    """Share of pixels that are off by more than WRONG codes when it is complete."""
    return _ended(radiance, eye, edge)[1]


_RIGHT = (
    f"a picture that says it is complete is the reference of {REFERENCE_SPP:,} samples a pixel; {WRONG} codes are what "
    "a viewer may see at an edge"
)
CASES = (
    *(
        case
        for radiance in (1.0, 4.0, 10.0)
        for case in (
            Case(
                name=f"rest_ends_{radiance:g}", family="Adaptive at rest", unit="times uniform", bound=AT_MOST,
                reason="a still view has to end; samples that are to go where they are needed may be at most eight "
                "times those that uniform sampling needs for the same error",
                scene=f"The edge of a lamp of radiance {radiance:g} before a sky of 0.2",
                measure=partial(soon, radiance, EYE), size=16, small=SMALL.get(radiance),
            ),
            Case(
                name=f"rest_right_{radiance:g}", family="Adaptive at rest", unit="share of pixels", bound=1e-4,
                reason=_RIGHT, scene="The same; pixels that are off by more than 5 codes of 8 bits",
                measure=partial(right, radiance, EYE), size=16, small=SMALL.get(radiance),
            ),
        )
    ),
    *(
        Case(
            name=f"rest_right_eye_{name}", family="Adaptive at rest", unit="share of pixels", bound=1e-4,
            reason="the same: samples of the moment shown count in the very pixels that they were traced for",
            scene=f"The lamp of radiance 1 for an eye {name.replace('_', ' ')} before the plane of a panel of 20 m, "
            "and as near to the lamp as shows the same picture",
            measure=partial(right, 1.0, metres), size=16, small=small,
        )
        for name, metres, small in (("1_mm", 1e-3, None), ("10_um", 1e-5, 10))
    ),
)  # fmt: skip
