"""Import Equalizer's `.eqc`: resources, canvases and compounds as a wall and its compositing graph."""

from __future__ import annotations

from collections.abc import Iterator

from wall.config.screens import WallConfig
from wall.core.errors import ConfigError
from wall.geometry.expanding import expand
from wall.importers.equalizer.canvases import drop_other_layouts, read_canvases
from wall.importers.equalizer.conversion_report import described, report_items
from wall.importers.equalizer.destinations import Destinations
from wall.importers.equalizer.grammar import Statement, parse
from wall.importers.equalizer.report_notes import note_compounds, note_nodes
from wall.importers.equalizer.resolved_values import GraphValues, ResolvedPanel, resolve_panel, share_channels
from wall.importers.equalizer.resources import read_resources
from wall.importers.equalizer.wall_values import wall_values
from wall.importers.report import Conversion, Item


def convert(text: str, name: str) -> Conversion:
    """The configuration that an Equalizer file describes, with a report on each of its statements.

    Raises NotThisFormat for a file that does not begin like one, ConfigError (name:line:column: what came; wanted)
    for a mistake in it.
    """
    top = parse(text, name)
    config = _config(top, name)
    resources = read_resources(config, _fullscreen(top))
    if not resources.channels:
        raise ConfigError(f"{name}:{config.line}:{config.column}: no channel in this config; wanted: node {{ pipe {{ "
                          "window { channel { } } } }")  # fmt: skip
    segment_views = read_canvases(config, resources, name)
    destinations = Destinations(config, resources, segment_views, name).read()
    drop_other_layouts(config, segment_views)
    wall = wall_values(destinations, _eye_base(top), name)
    panels = [resolve_panel(part, name) for part in wall.parts]
    share_channels(panels)
    screens = {panel.id: panel.screen for panel in expand(WallConfig.model_validate({"panels": wall.panels})).panels}
    graph = GraphValues(panels, screens)
    view = {"id": "main", "camera": "auto", "eye": wall.eye, "eye_separation": wall.separation}
    values = {
        "version": 1,
        "scene": {"source": "courtyard"},
        "wall": {"panels": wall.panels},
        "views": [view],
        "graph": graph.values(),
    }
    note_nodes(config, resources, _used(panels), graph.hosts)
    note_compounds(panels)
    carried, left = report_items(top)
    shown_ids = {panel["id"] for panel in wall.panels}
    assumed = ["an Equalizer file names no scene: this one shows the courtyard", *wall.assumed]
    return Conversion(
        values=values, carried=carried, not_carried=left, panels=len(wall.panels), ranks=graph.renderers,
        assumed=assumed,
        origins=[Item(what=described(one.statement), line=one.statement.line) for one in destinations
                 if one.id in shown_ids],
    )  # fmt: skip


def _config(top: Statement, name: str) -> Statement:
    """The first config of the file, which is the one that a server gives to its first client."""
    found = [one for one in top.walk() if one.word == "config" and one.body is not None]
    if not found:
        server = top.all("server")[0]
        raise ConfigError(f"{name}:{server.line}:{server.column}: server without a config; wanted: config {{ ... }}")
    for other in found[1:]:
        for one in other.walk():
            one.drop(f"one wall a file: the config of line {found[0].line} is carried over")
    return found[0]


def _globals(top: Statement, *words: str) -> Iterator[Statement]:
    """Statements of the file's global blocks with one of these words."""
    for block in top.all("global"):
        yield from block.all(*words)


def _fullscreen(top: Statement) -> bool:
    """Whether windows are full screen that do not say it themselves."""
    value = False
    for one in _globals(top, "EQ_WINDOW_IATTR_HINT_FULLSCREEN"):
        value = str(one.values[0]) in ("ON", "1")
        one.carry("panels without a window of their own" if value else "")
    return value


def _eye_base(top: Statement) -> float | None:
    """Metres between both eyes, from the file's globals or its config; None where neither says."""
    found = list(_globals(top, "EQ_CONFIG_FATTR_EYE_BASE"))
    for config in (one for one in top.walk() if one.word == "config"):
        found.extend(one for block in config.all("attributes") for one in block.all("eye_base"))
    for one in found:
        one.carry("views[0].eye_separation")
    return float(found[-1].values[0]) if found else None


def _used(panels: list[ResolvedPanel]) -> set[int]:
    """Identities of the channels that render for a panel or join rendered parts."""
    drawing = {id(draw.where) for one in panels for draw in one.draws}
    return drawing.union(*(one.joiners for one in panels))
