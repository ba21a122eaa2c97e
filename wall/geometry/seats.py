"""From where panels are seen: the eyes of all views, and how far a tracked one moves. For curved panels alone."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wall.config.screens import PanelConfig
from wall.config.views import ViewConfig
from wall.core.data import Float64
from wall.geometry.eyes import eye_of
from wall.geometry.panels import Panel
from wall.operators.curve import CurvedImage


class Seat(NamedTuple):
    """The eye of one view."""

    eye: Float64  # (3,) metres, wall frame
    separation: float  # metres from the left eye to the right one
    reach: float  # metres along each axis that a tracked eye moves from there


def seats(views: Sequence[ViewConfig]) -> tuple[Seat, ...]:
    """The seats of the views that say where their eye is."""
    return tuple(
        Seat(np.array(view.eye), view.eye_separation, 0.0 if view.tracking is None else view.tracking.reach)
        for view in views
        if view.eye is not None
    )


def eyes_before(panel: PanelConfig, shift: float, seats: Sequence[Seat]) -> Float64:
    """(n, 3) metres, wall frame: who may look at a panel; of tracked eyes the corners of the box that they stay in.

    shift : of the eye that sees it to the wall frame's right, eye separations. A panel's own eye is not tracked.
    """
    found = []
    for seat in seats or (Seat(np.zeros(3), 0.0, 0.0),):
        own = seat.eye if panel.eye is None else np.array(panel.eye)
        eye = own + np.array([shift * seat.separation, 0.0, 0.0])
        reach = seat.reach if panel.eye is None else 0.0
        found += [eye + reach * np.array(way) for way in itertools.product((-1.0, 1.0), repeat=3)] if reach else [eye]
    return np.array(found)


def curved_image(panel: Panel, views: Sequence[ViewConfig]) -> CurvedImage:
    """What turns the flat image of a curved panel into what it shows."""
    assert panel.surface is not None
    view = views[max(panel.view, 0)]
    eye = np.zeros(3) if view.eye is None else np.array(view.eye)
    plane = panel.plane
    return CurvedImage(
        centres=panel.surface.centres,
        window=np.array([plane.point(*panel.screen), plane.per_x, plane.per_y]),
        eye=eye_of(panel, eye, view.eye_separation),
        tracked=panel.config.eye is None,
    )
