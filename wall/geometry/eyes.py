"""Where eyes stand before the wall, in metres: the view's own, a panel's own, and the two of a viewer in stereo."""

from __future__ import annotations

import math

import numpy as np

from wall.config.loading import Loaded
from wall.config.views import DEFAULT_FOV_DEGREES
from wall.config.yaml_text import YamlPath
from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.geometry.frusta import distance_before
from wall.geometry.panels import Panel, Wall

NEAREST_EYE_M = 1e-6  # nearer to a panel's plane, its pixels have no directions


def standing_eye(loaded: Loaded, wall: Wall, view: int, fov: float = DEFAULT_FOV_DEGREES) -> Float64:
    """(3,) metres, wall frame: the view's eye, or the default one; fov : degrees, where the configuration has none.

    Raises ConfigError: a wall that is not flat has no default, or an eye is behind the panel that it looks at.
    """
    config = loaded.config.views[view]
    if config.eye is None and not wall.flat:
        message = "the wall is not flat, so the eye's place is needed"
        raise loaded.error(("views", view), message, "eye: [x, y, z] in metres")
    eye = default_eye(wall, config.camera.fov or fov) if config.eye is None else np.array(config.eye, dtype=np.float64)
    problems = [_refusal(loaded, panel, view, eye) for panel in wall.panels]
    if said := dict.fromkeys(str(problem) for problem in problems if problem):
        raise ConfigError("\n".join(said))
    return eye


def _refusal(loaded: Loaded, panel: Panel, view: int, eye: Float64) -> ConfigError | None:
    config = loaded.config.views[view]
    before = distance_before(panel, eye_of(panel, eye, config.eye_separation))
    if before >= NEAREST_EYE_M:
        return None
    own = panel.config.eye is not None
    path: YamlPath = (*panel_path(loaded, panel), "eye") if own else ("views", view, "eye")
    where = f"is {-before:.3g} m behind" if before < -NEAREST_EYE_M else "is in the plane of"
    which = {0.0: ""}.get(panel.shift, f", for the {panel.config.stereo} eye")
    accepted = "a point that sees its front" if own else "a point that sees the front of every panel"
    return loaded.error(path, f"{where} panel {panel.id}{which}", accepted)


def panel_path(loaded: Loaded, panel: Panel) -> YamlPath:
    """Where a panel stands in the file: its own entry, or the grid."""
    configs = loaded.config.wall.panels
    if configs is None:
        return ("wall", "grid")
    return ("wall", "panels", next(k for k, config in enumerate(configs) if config.id == panel.of))


def eye_of(panel: Panel, eye: Float64, separation: float) -> Float64:
    """(3,) metres, wall frame: who looks at a panel. The very array of the view's eye unless the panel has its own.

    Parameters
    ----------
    eye : (3,) metres, wall frame, of the view
    separation : metres from the left eye to the right one; they stand at each side of the eye along the frame's x
    """
    own = eye if panel.config.eye is None else np.array(panel.config.eye)
    return own + np.array([panel.shift * separation, 0.0, 0.0]) if panel.shift else own


def default_eye(wall: Wall, fov_degrees: float) -> Float64:
    """(3,) metres, wall frame: before a flat wall's centre, so far that its height spans `fov_degrees`."""
    corners = wall.outline
    height = float(np.linalg.norm(corners[2] - corners[0]))
    centre = (corners[1] + corners[2]) / 2
    distance = height / 2 / math.tan(math.radians(fov_degrees) / 2)
    eye: Float64 = centre + distance * wall.panels[0].plane.normal
    return eye
