"""`wall check`: validate a configuration and report what would run where, with what, at what rate."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

from rich.table import Table

from wall.commands.costs import costs_of, left_out, table_of
from wall.commands.expectations import expected
from wall.commands.fields import fields_of_packets, name_of
from wall.commands.memory import memory_lines
from wall.commands.one_core import measured_core
from wall.commands.terminal import si
from wall.config.loading import Loaded
from wall.config.views import ViewConfig
from wall.geometry.panels import Panel, Wall
from wall.reconstruction.choice import choose, why_not_on_gpu
from wall.roles.edges import target_ranks
from wall.roles.plan import Layout, Plan, check_files, make_layout, make_plan, why_not_at_renderer
from wall.run.first_look import dark_views
from wall.run.sinks import check_page
from wall.scene.build import Scene
from wall.scene.sources import sources_of
from wall.tracing.tracer_scene import make_tracer_scene

MOST_NAMES = 8  # of nodes in a line


def check(loaded: Loaded, *, costs: bool = False) -> Iterator[str | Table]:
    """Yield the report as lines and tables. Raises ConfigError where the configuration is refused.

    `costs`: each feature of the first renderer's scene is measured, which takes some seconds for each, and compiles.
    """
    layout = make_layout(loaded)
    check_files(layout)
    check_page(layout)
    plan = make_plan(layout)
    scene, wall = plan.scene, layout.wall
    sampling = layout.sampling_of(layout.region(layout.renderers()[0]).view)
    shown = (*sources_of(loaded.config.scene), *(data.file for data in loaded.config.scene.data))
    yield f"{loaded.path}: ok"
    yield _extent(plan)
    if len(plan.views) > 1:
        yield f"views: {'; '.join(map(_described, layout.config.views))}"
    if table := _displays(wall):
        yield table
    yield (
        f"scene: {', '.join(shown)}, {scene.triangles:,} {_primitives(scene)} in "
        f"{len(scene.instances):,} objects of {len(scene.meshes):,} meshes, "
        f"{len(scene.point_lights)} point, {len(scene.spot_lights)} spot and {len(scene.directional_lights)} "
        "directional lights"
    )
    if not costs:
        yield from tracers(plan)
    tracer_scene = make_tracer_scene(scene)
    for note in (*layout.notes, *scene.notes, *dark_views(plan, tracer_scene)):
        yield f"note: {note}"
    yield launch_line(layout, os.cpu_count() or 1)
    yield _ranks(layout)
    yield from memory_lines(plan)
    yield from layers_apart(layout)
    yield from reconstructions(plan)
    yield from at_renderers(layout)
    yield from fields_of_packets(plan)
    if costs:
        yield from measured_features(plan)
    core = measured_core(plan, tracer_scene)
    yield (
        f"expected: {sampling.method} with {sampling.threads} thread{'s' * (sampling.threads > 1)} a rank; "
        f"one core of this machine, if it only traces, traces {si(core.rate).strip()} samples/s of rank "
        f"{layout.renderers()[0]}'s region, {si(core.rate * core.size)}B/s ({core.size:.1f} bytes a sample)"
    )
    yield from expected(layout, core, os.cpu_count() or 1)


def _extent(plan: Plan) -> str:
    """The wall's size, rate and eye."""
    wall, eye = plan.layout.wall, plan.view.eye
    width, height = wall.extent
    across = abs(float(wall.panels[0].plane.normal @ (eye - wall.panels[0].corners[0])))
    return (
        f"wall: {len(wall.panels)} panel{'s' * (len(wall.panels) > 1)} on {wall.width}x{wall.height} pixels, "
        f"{_short(width)} x {_short(height)} m, shown at {plan.view.refresh_hz:g} Hz; the eye is "
        f"{_short(across)} m before panel {wall.panels[0].id}, at ({', '.join(_short(x + 0.0) for x in eye.round(6))})"
    )


def _short(value: float) -> str:
    """A length to three digits, without a power of ten where it is large."""
    return f"{value:,.0f}" if abs(value) >= 999.5 else f"{value:.3g}"


def launch_line(layout: Layout, cores: int) -> str:
    """How to start the ranks; mpirun refuses more ranks than a machine has cores unless it is told to oversubscribe."""
    start = f"mpirun --with-ft ulfm -x PATH -n {layout.size} wall run {layout.loaded.path}"
    if layout.size <= cores:
        return f"launch: {start}"
    return (
        f"launch: {start} on several machines; here {start.replace('mpirun', 'mpirun --oversubscribe')}: "
        f"{layout.size} ranks share {cores} cores"
    )


def _primitives(scene: Scene) -> str:
    meshes = [scene.meshes[instance.mesh] for instance in scene.at_once]
    kinds = {
        "triangles": any(mesh.spheres is None for mesh in meshes),
        "spheres": any(mesh.spheres is not None and mesh.segments is None for mesh in meshes),
        "segments of curves": any(mesh.segments is not None for mesh in meshes),
    }
    return " and ".join(name for name, there in kinds.items() if there)


def _described(view: ViewConfig) -> str:
    own = [] if view.integrator is None else [view.integrator.method.replace("_", " ")]
    if (time := view.time) is not None:
        whose = "a time of its own from" if time.follow is None else f"{time.follow}'s time, shifted by"
        own.append(f"{whose} {time.offset_s:g} s" + ", paused" * time.paused)
    return ", ".join([f"{view.id} at {view.refresh_hz:g} Hz with weight {view.weight:g}", *own])


def tracers(plan: Plan) -> Iterator[str | Table]:
    """A table of features for each integrator, with the views that have it, and a line of what is left out."""
    for view, views in _alike([id(scene) for scene in plan.scenes], plan.layout):
        yield table_of(plan.scene_of(view), f"features{views}")
        yield left_out(plan.scene_of(view))


def measured_features(plan: Plan) -> Iterator[str | Table]:
    """The table of features of the first renderer's view, each of them measured by leaving it out."""
    layout = plan.layout
    rank = layout.renderers()[0]
    found = dict(costs_of(plan))
    whole = found.pop("")
    yield f"costs: of rank {rank}; a sample of all features takes {whole.ns:.0f} ns of CPU, {whole.bytes:.2f} bytes"
    yield table_of(plan.scene_of(layout.region(rank).view), "features, and what each takes", found)
    yield left_out(plan.scene_of(layout.region(rank).view))


def reconstructions(plan: Plan) -> Iterator[str]:
    """A line about what reconstructs, for each wish, and lines about layers that it is not for."""
    layout = plan.layout
    wishes = [layout.config.reconstruction_of(view) for view in range(len(layout.config.views))]
    choices = [(choose(wishes[view]), views) for view, views in _alike(wishes, layout)]
    for choice, views in choices:
        yield f"reconstruction{views}: {choice}"
    if any(choice.on == "gpu" for choice, _ in choices):
        yield from on_the_cpu(plan)


def _alike(of_views: Sequence[int | str], layout: Layout) -> Iterator[tuple[int, str]]:
    """The first view of each value that views have, and words for all that have it, unless these are all views."""
    for value in dict.fromkeys(of_views):
        names = [view.id for own, view in zip(of_views, layout.config.views, strict=True) if own == value]
        yield of_views.index(value), f" of {_some(names)}" * (len(names) < len(of_views))


def layers_apart(layout: Layout) -> Iterator[str]:
    """Lines about layers with a rate or a resolution of their own."""
    for layer in layout.graph.layers:
        width, height = layout.wall.traced[layer.traced].pixels
        said = []
        if layer.scale < 1.0:
            said.append(f"traced with {width}x{height} pixels and enlarged")
        if layer.samples_hz is not None:
            most = layer.samples_hz * width * height
            said.append(f"at most {layer.samples_hz:g} whole images a second traced ({most:,.0f} samples/s)")
        if layer.refresh_hz is not None:
            shown = layout.config.views[layer.view].refresh_hz
            said.append(f"reconstructed at {layer.refresh_hz:g} Hz, and moved to the {shown:g} Hz of its view")
        if said:
            yield f"layer {name_of(layout, layer)}: {'; '.join(said)}"


def on_the_cpu(plan: Plan) -> Iterator[str]:
    """Lines about layers that the CPU reconstructs even where there is a GPU, with the reason."""
    layout, found = plan.layout, dict[str, list[str]]()
    for layer in layout.graph.layers:
        if layout.config.reconstruction_of(layer.view) == "cpu":
            continue
        if why := why_not_on_gpu(plan.scene_of(layer.view), layout.wall.traced[layer.traced]):
            found.setdefault(why, []).append(name_of(layout, layer))
    for why, names in found.items():
        yield f"reconstruction: cpu for {_some(names)}: {why}"


def at_renderers(layout: Layout) -> Iterator[str]:
    """Lines about which layers their renderers reconstruct, and why others' samples travel."""
    found: dict[str, list[str]] = {}
    for layer in layout.graph.layers:
        found.setdefault(why_not_at_renderer(layout, layer), []).append(name_of(layout, layer))
    for why, names in found.items():
        if why:
            yield f"reconstruction: samples of {_some(names)} travel to a compositor: {why}"
        else:
            yield f"reconstruction: {_some(names)} at the renderer, if it shares a machine with the compositor"


def _some(names: list[str]) -> str:
    return ", ".join(names[:MOST_NAMES]) + (f" and {len(names) - MOST_NAMES} more" * (len(names) > MOST_NAMES))


def _ranks(layout: Layout) -> Table:
    """A table of the ranks: role, host, region or nodes, and the ranks that each sends to."""
    hosts = layout.graph.hosts
    table = Table(title=f"{layout.size} ranks", title_justify="left")
    for column in ("rank", "role", *(["host"] if hosts else []), "has", "sends to"):
        table.add_column(column)
    for rank in range(layout.size):
        renders = layout.role(rank) == "renderer"
        targets = target_ranks(layout.graph, rank)
        if renders:
            targets = {layout.layer(region).compositor for region in layout.regions_of(rank)}
        names = ", ".join(f"rank {target}" for target in sorted(targets))
        host = [hosts.get(rank, "any")] if hosts else []
        table.add_row(str(rank), layout.role(rank), *host, layout.describe(rank), names)
    return table


def _displays(wall: Wall) -> Table | None:
    """A table of the panels and the displays that show them; None where the configuration names none."""
    configs = [(p, p.config) for p in wall.panels]
    rows = [(p, c.host or "", c.display or "", "" if c.monitor is None else str(c.monitor)) for p, c in configs]
    if not any(any(names) for _, *names in rows):
        return None
    table = Table(title="displays", title_justify="left")
    for column in ("panel", "pixels", "host", "display", "monitor", "overlaps, m"):
        table.add_column(column)
    for panel, *names in rows:
        turned = f", turned {panel.config.rotation}" if panel.config.rotation else ""
        table.add_row(panel.id, f"{panel.pixels[0]}x{panel.pixels[1]}{turned}", *names, _overlapped(panel))
    return table


def _overlapped(panel: Panel) -> str:
    """How wide a panel and its neighbours light the same, and which edges it fades out."""
    sides = {side: wide for side, wide in panel.config.overlap.model_dump().items() if wide}
    fades = "" if panel.blend is None else ", blended"
    return ", ".join(f"{side} {wide:.3g}" for side, wide in sides.items()) + fades * bool(sides)
