"""`wall.render`: converged images as arrays, those of `wall render`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from wall.commands.one_view import plan_of_view
from wall.commands.render import render_layers
from wall.core.data import Float32
from wall.core.errors import ConfigError
from wall.core.mpi import under_mpi
from wall.sampling.pixel_layers import Layer, checked_layers
from wall.scripting.scene import Scene

Words = Mapping[str, Any]  # of a configuration
MOST_SAMPLES = 65536
MOST_SEED = 2**32 - 1


@overload
def render(
    scene: Scene | str | Path, *, camera: str | Words | None = ..., size: tuple[int, int] | None = ...,
    samples: int = ..., integrator: str | Words | None = ..., layers: None = ..., seed: int = ...,
    at: float = ..., view: str | None = ...,
) -> Float32: ...  # fmt: skip


@overload
def render(
    scene: Scene | str | Path, *, camera: str | Words | None = ..., size: tuple[int, int] | None = ...,
    samples: int = ..., integrator: str | Words | None = ..., layers: Sequence[str], seed: int = ...,
    at: float = ..., view: str | None = ...,
) -> dict[str, Layer]: ...  # fmt: skip


def render(
    scene: Scene | str | Path,
    *,
    camera: str | Words | None = None,
    size: tuple[int, int] | None = None,
    samples: int = 64,
    integrator: str | Words | None = None,
    layers: Sequence[str] | None = None,
    seed: int = 1,
    at: float = 0.0,
    view: str | None = None,
) -> Float32 | dict[str, Layer]:
    """Render one converged image: (h, w, 3) float32, linear RGB, row 0 at the top; the same bits for a seed.

    scene : a Scene, or what a Scene is made of
    camera : words of `views[].camera`, such as {"position": (0, 1, 5), "target": (0, 0, 0), "fov": 40}, "auto", or the
        name of a camera of the source; it then stands still, in all views that are rendered. None: as they have it
    size : width and height, pixels, of the wall's shape where that is not flat, or shows several views; None: its own
    samples : a pixel, 1 to 65536
    integrator : "direct", "path", "ambient_occlusion", or words such as {"method": "path", "depth": 4}
    layers : of "albedo", "normal", "depth", "variance", "object_id". With it the result is a dictionary of arrays, the
        image itself is "colour": albedo and normal (h, w, 3) float32, means of 0..1 and unit vectors in the world's
        axes, 0 of the sky; depth (h, w) float32, world units from the eye to the pixel's nearest sample, inf where
        there is none, and object_id (h, w) uint32 of that sample, 0 of the sky; variance (h, w) float32 of each
        pixel's mean, mean of the three channels
    seed : of random numbers, 0 to 2^32 - 1
    at : time of the animation, seconds
    view : name of the view to render, as large as its place on the wall; None: all, in their places

    Raises ConfigError for what cannot be rendered.
    """
    _check(size, samples=samples, seed=seed, at=at)
    if isinstance(layers, str):
        raise ConfigError(f"layers = {layers!r}: is not a list; accepted: a list or tuple of names")
    names = checked_layers(layers or (), where="layers")
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    views = [each.id for each in scene.loaded.config.views]
    changes: dict[str, Any] = {}
    if camera is not None:
        changes |= {"camera": _camera(camera), "path": None}
    if integrator is not None:
        changes["integrator"] = {"method": integrator} if isinstance(integrator, str) else integrator
    numbers = [views.index(view)] if view in views else range(len(views))
    loaded = scene.with_views(numbers, changes) if changes else scene.loaded
    plan, tracer_scene = scene.planned(loaded)
    if view is not None:
        plan = plan_of_view(plan, view)
    found = render_layers(
        plan,
        spp=int(samples),
        seed=int(seed),
        at=float(at),
        size=None if size is None else (int(size[0]), int(size[1])),
        layers=names,
        tracer_scene=tracer_scene.under(plan.scene),
    )
    assert found is not None  # it is only at other ranks of MPI
    return found["colour"] if layers is None else found


def _camera(camera: str | Words) -> str | Words:
    return {"name": camera} if isinstance(camera, str) and camera != "auto" else camera


def _is_size(value: object) -> bool:
    return isinstance(value, tuple | list) and len(value) == 2 and all(_is_whole(n) and n > 0 for n in value)


def _is_whole(value: object) -> bool:
    return isinstance(value, int | np.integer)


def _check(size: tuple[int, int] | None, *, samples: int, seed: int, at: float) -> None:
    """Refuse what the command line would refuse."""
    if under_mpi():
        raise ConfigError(
            "wall.render uses the cores of one machine: start it without mpirun; `wall render` uses ranks"
        )
    if size is not None and not _is_size(size):
        raise ConfigError(f"size = {size!r}: is no size; accepted: width and height in pixels, as in (960, 540)")
    if not (_is_whole(samples) and 1 <= samples <= MOST_SAMPLES):
        raise ConfigError(f"samples = {samples!r}: accepted: a whole number from 1 to {MOST_SAMPLES}")
    if not (_is_whole(seed) and 0 <= seed <= MOST_SEED):
        raise ConfigError(f"seed = {seed!r}: accepted: a whole number from 0 to {MOST_SEED}")
    if not (isinstance(at, int | float | np.number) and 0.0 <= at < float("inf")):
        raise ConfigError(f"at = {at!r}: accepted: seconds from 0 on")
