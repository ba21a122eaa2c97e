"""A configuration as one method runs it: its sampling, no windows or page, something that moves."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, get_args

from wall.config.graph import GraphConfig, NodeGraph, SinkNode
from wall.config.loading import Loaded, dump, load
from wall.config.sampling import AnySampling, switched
from wall.config.views import OrbitPathConfig, without_borders
from wall.core.errors import ConfigError
from wall.geometry.expanding import expanded_config
from wall.roles.plan import Layout, Plan, aimed, make_layout, make_plan, why_not_at_renderer
from wall.study.quality.methods_reduced import FULL_ROWS
from wall.study.quality.methods_reduced import ROWS as ROWS_OF_FULL

Rows = Literal["known", "middle", "ignored"]  # what a renderer makes of `row_time`
ROWS: tuple[Rows, ...] = get_args(Rows)
ONE_MOMENT = 1e-12  # seconds a row: all rows are made for the same moment, and samplers predict it all the same
ORBIT_PERIOD_S = 20.0  # of a camera in a scene where nothing else moves
REDUCED = {f"reduced_{rows}": rows for rows in ROWS_OF_FULL}  # framed, of fewer pixels; enlarged where it is scored
PATIENCE_S = 30.0  # a rank that few cores are slow to run is not lost
SHOWS_PANELS = frozenset({  # nodes after which a panel still shows its own view, and nothing beside it
    "age_blend", "average", "crop", "denoise", "depth", "encode", "newest", "over", "reconstruct", "samples", "sink",
    "sky", "tile",
})  # fmt: skip
FILE_KEYS = frozenset(
    {"source", "file", "lut", "certificate", "key"}
)  # whose relative paths start at the configuration's folder


def load_without_windows(path: Path, *, several: bool = False) -> Loaded:
    """A configuration whose images end at the head, without borders. Raises ConfigError where none is a reference.

    `several`: views are allowed; references are of the first alone.
    """
    loaded = load(path)
    if len(loaded.config.views) > 1 and not several:
        raise loaded.error(("views", 1), "only one view can be measured so", "one view, or wall measure views")
    graph, views = _without_windows(loaded.config.graph), without_borders(loaded.config.views)
    loaded = loaded.with_config(loaded.config.model_copy(update={"graph": graph, "views": views}))
    _check_graph(make_layout(loaded))
    return loaded


def left_out(path: Path) -> str:
    """What the windows of a configuration make of images, and the same without windows does not; "" for nothing."""
    shown, measured = make_layout(load(path)), make_layout(load_without_windows(path))
    travel = {
        layer.node: why
        for layer in shown.graph.layers
        if (why := why_not_at_renderer(shown, layer)) and not why_not_at_renderer(measured, layer)
    }
    if not travel:
        return ""
    return (
        f"{path.stem}: measured before its windows: without blend, warp, colour and masks. With windows samples of "
        f"{', '.join(travel)} travel to a compositor ({next(iter(travel.values()))}), here their renderers make the "
        "images: rates and latencies of the wall itself differ, see summary.json of a run"
    )


def moving(loaded: Loaded) -> Plan:
    """Load the scene; where nothing moves, neither camera nor objects, the camera is given an orbit."""
    plan = make_plan(make_layout(loaded))
    view = loaded.config.views[0]
    if view.path is not None or plan.scene.animated:
        return plan
    view = view.model_copy(update={"path": OrbitPathConfig(type="orbit", period_s=ORBIT_PERIOD_S)})
    loaded = loaded.with_config(loaded.config.model_copy(update={"views": (view,)}))
    return aimed(make_layout(loaded), plan.scene)


def text_for(loaded: Loaded, method: str) -> str:
    """YAML of the configuration under a method of METHODS or REDUCED, for a file in any folder."""
    if (rows := REDUCED.get(method)) is not None:
        loaded, method = of_fewer_pixels(loaded, rows), "framed"
    config = loaded.config
    transport = config.transport.model_copy(update={"lost_after_s": max(PATIENCE_S, config.transport.lost_after_s)})
    views = tuple(view.model_copy(update={"sampling": None}) for view in config.views)
    update = {"sampling": sampling_for(config.sampling_of(0), method), "views": views, "transport": transport}
    changed = config.model_copy(update=update)
    values = _absolute(changed.model_dump(mode="json", exclude_none=True), loaded.folder.absolute())
    return dump(type(config).model_validate(values))


def text_in_motion(loaded: Loaded) -> str:
    """YAML of the configuration, for a file in any folder; the first camera is given an orbit if it has no path."""
    config, first = loaded.config, loaded.config.views[0]
    if first.path is None:
        first = first.model_copy(update={"path": OrbitPathConfig(type="orbit", period_s=ORBIT_PERIOD_S)})
    changed = config.model_copy(update={"views": (first, *config.views[1:])})
    values = _absolute(changed.model_dump(mode="json", exclude_none=True), loaded.folder.absolute())
    return dump(type(config).model_validate(values))


def with_rows(loaded: Loaded, rows: Rows) -> Loaded:
    """The configuration for a renderer that knows when rows are shown, or not, or that makes all for one moment."""
    if rows == "known":
        return loaded
    config, layout = loaded.config, make_layout(loaded)
    seconds = max((panel.scan_s for panel in layout.wall.panels), default=0.0)
    at_once = 0.0 if rows == "ignored" else ONE_MOMENT
    wall = expanded_config(config.wall)
    panels = tuple(
        panel.model_copy(update={"row_time": at_once if panel.row_time else 0.0}) for panel in wall.panels or ()
    )
    views = config.views
    if rows == "middle":
        views = tuple(view.model_copy(update={"display_delay_s": view.light_after_s + 0.5 * seconds}) for view in views)
    wall = wall.model_copy(update={"panels": panels})
    return loaded.with_config(config.model_copy(update={"wall": wall, "views": views}))


def of_fewer_pixels(loaded: Loaded, rows: int) -> Loaded:
    """The configuration on panels of `rows` rows for every FULL_ROWS, and columns to keep their aspect."""
    wall = expanded_config(loaded.config.wall)
    panels = tuple(
        panel.model_copy(update={"pixels": tuple(max(1, round(n * rows / FULL_ROWS)) for n in panel.pixels)})
        for panel in wall.panels or ()
    )
    wall = wall.model_copy(update={"panels": panels})
    return loaded.with_config(loaded.config.model_copy(update={"wall": wall}))


def sampling_for(sampling: AnySampling, method: str) -> AnySampling:
    """The same threads and seed under another method, the same batch only where the configuration says how large."""
    other = switched(sampling, method)
    if other is sampling or "samples_per_batch" in sampling.model_fields_set:
        return other
    return type(other)(threads=sampling.threads, seed=sampling.seed)


def _without_windows(graph: GraphConfig) -> GraphConfig:
    """The same graph, all of whose sinks are files at the head."""
    if not isinstance(graph, NodeGraph):
        return graph.model_copy(update={"sinks": ("png",)})
    nodes = tuple(
        node.model_copy(update={"kind": "png", "on": None}) if isinstance(node, SinkNode) else node
        for node in graph.nodes
    )
    return graph.model_copy(update={"nodes": nodes})


def _check_graph(layout: Layout) -> None:
    """Refuse a graph whose images are not what the panels' own rays see: there is no reference image of it."""
    strange = {step.node.op_name for step in layout.graph.steps} - SHOWS_PANELS
    if strange:
        raise ConfigError(
            f"{layout.loaded.path}: graph: {', '.join(sorted(strange))}: changes what a panel shows; wanted, to hold "
            f"it against a reference image, only {', '.join(sorted(SHOWS_PANELS))}"
        )


def _absolute(values: Any, folder: Path) -> Any:
    """The same values with absolute paths of files."""
    if isinstance(values, list):
        return [_absolute(value, folder) for value in values]
    if not isinstance(values, dict):
        return values
    return {
        key: str((folder / value).resolve())
        if key in FILE_KEYS and isinstance(value, str) and (folder / value).is_file()
        else _absolute(value, folder)
        for key, value in values.items()
    }
