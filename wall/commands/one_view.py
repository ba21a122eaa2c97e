"""One view of a wall by itself, as large as its place on the wall: what `--view` of offline commands renders."""

from __future__ import annotations

from dataclasses import replace

from wall.config.loading import nearest
from wall.core.errors import ConfigError
from wall.geometry.panels import Plane, Wall
from wall.roles.plan import Layout, Plan


def layout_of_view(layout: Layout, name: str) -> Layout:
    """The layout of one view, for its wall and its configuration; the graph stays that of all. Raises ConfigError."""
    k = _number(layout, name)
    config = layout.config.model_copy(update={"views": layout.config.views[k : k + 1]})
    wall = _cropped(layout.wall.of_view(k))
    return replace(layout, loaded=layout.loaded.with_config(config), wall=wall)


def plan_of_view(plan: Plan, name: str) -> Plan:
    """The plan of one view, which is its first. Raises ConfigError."""
    k = _number(plan.layout, name)
    layout = layout_of_view(plan.layout, name)
    return Plan(layout=layout, scene=plan.scene_of(k), views=plan.views[k : k + 1])


def plans_of_views(plan: Plan) -> list[Plan]:
    """The plan of each view by itself."""
    return [plan] if len(plan.views) == 1 else [plan_of_view(plan, view.id) for view in plan.layout.config.views]


def _number(layout: Layout, name: str) -> int:
    known = [view.id for view in layout.config.views]
    if name not in known:
        accepted = ", ".join(known) + nearest(name, known)
        raise ConfigError(f"--view {name}: {layout.loaded.path} has no such view; accepted: {accepted}")
    return known.index(name)


def _cropped(wall: Wall) -> Wall:
    """The wall whose virtual screen is just the rectangle around its panels."""
    left, top = (min(panel.screen[axis] for panel in wall.panels) for axis in (0, 1))
    right, bottom = (max(panel.screen[axis] + panel.span[axis] for panel in wall.panels) for axis in (0, 1))
    planes = {id(panel.plane): panel.plane for panel in wall.panels}  # panels of one plane go on sharing it
    moved = {
        key: Plane(origin=plane.point(left, top), per_x=plane.per_x, per_y=plane.per_y) for key, plane in planes.items()
    }
    panels = tuple(
        replace(panel, screen=(panel.screen[0] - left, panel.screen[1] - top), plane=moved[id(panel.plane)])
        for panel in wall.panels
    )
    return replace(wall, panels=panels, width=right - left, height=bottom - top)
