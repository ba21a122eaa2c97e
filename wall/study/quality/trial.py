"""One trial of the experiment: which scene, which method, at what rate, on which panel; and the plan it is run on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from wall.config.graph import PresetGraph
from wall.config.loading import Loaded, load
from wall.config.sampling import FramelessSampling
from wall.config.screens import GridConfig, WallConfig
from wall.config.views import KeyframesPathConfig
from wall.geometry.cameras import resolve_view
from wall.geometry.expanding import wall_of
from wall.roles.plan import Plan, make_layout, make_plan
from wall.study.quality.method import Setup
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

SECONDS = 4.0  # of a run, or longer where the camera's keyframes go on
WALL_HEIGHT_M = 0.27  # of the forced panel; only the angle that it fills matters


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What one run is; two equal trials give equal images (with the virtual clock)."""

    config: Path
    method: str
    rate: float  # primary rays a second; with clock "cpu" the rate that batches are sized for
    size: tuple[int, int]
    seed: int
    refresh_hz: float = 60.0
    seconds: float | None = None  # None: as long as the scene's camera path, at least SECONDS
    clock: str = "virtual"
    cores: float = 1.0  # with clock "cpu": CPU seconds a second

    @property
    def scene(self) -> str:
        """Name of the scene: the configuration's file name without ending."""
        return self.config.stem


def setup_of(trial: Trial) -> Setup:
    """The experiment's surroundings of a trial. Raises ConfigError."""
    plan, tracer_scene = scene_of(trial.config, trial.size)
    return Setup(plan=plan, tracer_scene=tracer_scene, rate=trial.rate, refresh_hz=trial.refresh_hz, seed=trial.seed)


@lru_cache(maxsize=2)
def scene_of(config: Path, size: tuple[int, int]) -> tuple[Plan, TracerScene]:
    """The plan of a configuration on one panel, and its scene as tracers keep it. Raises ConfigError."""
    plan = make_plan(make_layout(on_one_panel(load(config), size)))
    return plan, make_tracer_scene(plan.scene)


def on_one_panel(loaded: Loaded, size: tuple[int, int]) -> Loaded:
    """The same scene and view on one flat panel of `size` (width, height) pixels, seen under the same vertical angle.

    An eye before the wall is moved to the panel's axis. Sampling, graph and transport do not matter here and get
    their defaults. Raises ConfigError for what the file's own wall and view are refused for.
    """
    config, (width, height) = loaded.config, size
    view = config.views[0]
    fov = view.camera.fov if view.eye is None else _angle_seen(loaded)
    grid = GridConfig(columns=1, rows=1, pixels=size, size=(WALL_HEIGHT_M * width / height, WALL_HEIGHT_M))
    camera = view.camera.model_copy(update={"fov": fov})
    view = view.model_copy(update={"camera": camera, "eye": None, "sampling": None})
    update = {"wall": WallConfig(grid=grid), "views": (view,), "sampling": FramelessSampling(), "graph": PresetGraph()}
    return loaded.with_config(config.model_copy(update=update))


def _angle_seen(loaded: Loaded) -> float:
    """Degrees that the wall, or the panel ahead of one that is not flat, spans from top to bottom before the eye."""
    view = resolve_view(loaded, wall_of(loaded), (0.0, 0.0, 0.0), 1.0)
    return math.degrees(2.0 * math.atan(view.spread / 2.0))


def duration(plan: Plan, seconds: float | None) -> float:
    """Seconds of a run that asks for `seconds`, or leaves it to the scene."""
    if seconds is not None:
        return seconds
    path = plan.view.path
    last = path.keyframes[-1].time if isinstance(path, KeyframesPathConfig) else 0.0
    return max(SECONDS, last)
