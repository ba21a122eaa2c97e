"""Where several views are on the wall: each panel shows the last view that covers it whole, later ones are its insets.

Where no view covers a panel whole, insets must do so together.

An inset is a Panel in the plane of the one that it lies on, so its rays need no rule of their own.
"""

from __future__ import annotations

from dataclasses import replace

from wall.config.loading import Loaded, nearest
from wall.config.views import ViewConfig, ViewportConfig
from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.geometry.panels import NO_VIEW, Panel, Wall
from wall.geometry.rects import Rects, panel_rect
from wall.geometry.scan import Scan
from wall.operators.outline import SIDES, Side


def with_views(loaded: Loaded, wall: Wall) -> Wall:
    """The wall with what each panel shows, and its insets.

    Raises ConfigError with all that is wrong: panels that are not there, panels without a view, views that nobody sees.
    """
    views, problems = loaded.config.views, list[str]()
    for k, view in enumerate(views):
        problems += [str(_unknown(loaded, wall, k, name)) for name in view.panels or () if name not in _ids(wall)]
        if view.panels is not None and view.viewport is not None:
            accepted = "one of panels, viewport"
            problems.append(str(loaded.error(("views", k, "viewport"), "it has panels already", accepted)))
    if problems:
        raise ConfigError("\n".join(problems))
    panels, insets = list[Panel](), list[Panel]()
    for panel in wall.panels:
        whole = panel_rect(panel)
        places = [_on_panel(view, wall, panel) for view in views]
        own = max((k for k, rect in enumerate(places) if rect == whole), default=NO_VIEW)
        parts = {k: rect for k, rect in enumerate(places) if rect is not None and k > own}
        if own == NO_VIEW and Rects(list(parts.values())).left_of(whole):
            wanted = "neither panels nor viewport in the first view, which then fills what others leave"
            problems.append(str(loaded.error(("views", 0), f"no view fills panel {panel.id}", wanted)))
        panels.append(replace(panel, view=own))
        insets += [_inset(panel, rect, views[k], k) for k, rect in parts.items()]
    if not problems:
        seen = {panel.view for panel in (*panels, *insets)}
        hidden = [k for k in range(len(views)) if k not in seen]
        wanted = "a place on some panel that later views do not fill"
        problems = [str(loaded.error(("views", k), "nobody sees any of it", wanted)) for k in hidden]
    if problems:
        raise ConfigError("\n".join(problems))
    insets = [replace(inset, index=len(panels) + k) for k, inset in enumerate(insets)]
    return replace(wall, panels=tuple(panels), insets=tuple(insets))


def _ids(wall: Wall) -> set[str]:
    """What views call panels: their ids, or that of a display for both eyes."""
    return {panel.id for panel in wall.panels} | {panel.of for panel in wall.panels}


def _unknown(loaded: Loaded, wall: Wall, view: int, name: str) -> ConfigError:
    known = [panel.id for panel in wall.panels]
    accepted = ", ".join(known[:8]) + (" ..." if len(known) > 8 else "") + nearest(name, known)
    return loaded.error(("views", view, "panels"), f"there is no panel {name}", accepted)


def _on_panel(view: ViewConfig, wall: Wall, panel: Panel) -> Rect | None:
    """Where a view is on a panel, virtual screen; None: nowhere."""
    whole, part = panel_rect(panel), view.viewport
    if part is None:
        return whole if view.panels is None or {panel.id, panel.of} & set(view.panels) else None
    return _on_wall(part, wall).intersection(whole)


def _on_wall(part: ViewportConfig, wall: Wall) -> Rect:
    """Where a viewport is, virtual screen."""
    x, y = round(part.left * wall.width), round(part.top * wall.height)
    right, bottom = round((part.left + part.width) * wall.width), round((part.top + part.height) * wall.height)
    return Rect(x=x, y=y, width=right - x, height=bottom - y)


def edges_of(panel: Panel, view: ViewConfig, wall: Wall) -> tuple[Side, ...]:
    """Which edges of a view's viewport lie on a panel, or an inset, that shows it or a part of it."""
    if view.viewport is None:
        return ()
    whole, own = _on_wall(view.viewport, wall), panel_rect(panel)
    lie = {
        "left": own.x == whole.x, "top": own.y == whole.y,
        "right": own.right == whole.right, "bottom": own.bottom == whole.bottom,
    }  # fmt: skip
    return tuple(side for side in SIDES if lie[side])


def _inset(panel: Panel, rect: Rect, view: ViewConfig, index: int) -> Panel:
    size = (rect.width, rect.height)
    return replace(
        panel, id=f"{panel.id}.{view.id}", pixels=size, screen=(rect.x, rect.y), span=size, blend=None, view=index,
        inset_of=panel.index, scan=_scan_of(panel, rect), surface=None,
    )  # fmt: skip


def _scan_of(panel: Panel, rect: Rect) -> Scan | None:
    """When a panel's display lights a rectangle of the virtual screen, whose pixels are as large as the screen's."""
    if panel.scan is None:
        return None
    across, down = (pixels / span for pixels, span in zip(panel.pixels, panel.span, strict=True))
    x, y = (rect.x - panel.screen[0]) * across, (rect.y - panel.screen[1]) * down
    return Scan(first=panel.scan.at(x, y), per_x=panel.scan.per_x * across, per_y=panel.scan.per_y * down)
