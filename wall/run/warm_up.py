"""Compile the kernels that a scene needs before any rank starts, once a machine, saying so meanwhile.

numba compiles a kernel when it is first called with new argument types; here that happens on a few pixels, in an order
that lets progress be shown. A lock in the cache folder makes ranks that start together wait for one compiler.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import numpy as np

from wall.config.graph import SkyNode
from wall.core.clock import ManualClock
from wall.core.colour import srgb_curve
from wall.core.data import SAMPLE, Batch, Framelet, Rect, Region
from wall.core.errors import ConfigError
from wall.core.jit import when_compiling
from wall.core.kernel_cache import cache_root, compiled_kernels, locked
from wall.display.cheapest import exact_tiles
from wall.display.kernels.tiles import take_visible
from wall.display.tiles import TILE, changed_tiles
from wall.operators.base import Operator
from wall.operators.kernels import pixels as kernels
from wall.packets.framelets import FrameletPart
from wall.packets.samples import Codec, decode, encode
from wall.roles.layer import PanelCompositor
from wall.roles.plan import Plan, first_event
from wall.roles.sky import SkyLayer
from wall.roles.status import samplers_of
from wall.roles.timewarp import Timewarp
from wall.roles.worker import Worker, make_samplers
from wall.scene.needs import needs
from wall.scene.picking import Picking
from wall.tracing.tracer_scene import TracerScene

ENOUGH_KERNELS = 30  # in the cache: some scene has been compiled; for the few that another one lacks no second compiler
LONGEST_OTHERS_S = 300.0  # that another process's compiling is waited for: two at once take longer, and harm nothing
ADAPTIVE = "adaptive"  # last of all samplers: the second compiler has begun with it
TINY = Rect(x=0, y=0, width=8, height=8)


def usable_samplers(plan: Plan, *, headless: bool) -> tuple[str, ...]:
    """The samplers that a run may come to use, `adaptive` last: those configured, and those that viewers may choose.

    `headless`: there are neither pages nor windows, and so no viewers.
    """
    layout = plan.layout
    methods: set[str] = {layout.sampling_of(view).method for view in range(len(plan.views))}
    if not headless and (layout.graph.has_sink("browser") or layout.graph.has_sink("window")):
        methods.update(samplers_of(plan))
    return tuple(sorted(methods, key=lambda method: (method == ADAPTIVE, method)))


def warm_up(
    plan: Plan,
    tracer_scene: TracerScene,
    say: Callable[[str], None],
    *,
    headless: bool = False,
    beside: bool = False,
) -> None:
    """Run the chain on a few pixels with every sampler in use: a second from the cache, half a minute to compile.

    `headless`: see usable_samplers; `beside`: while a wall runs in this process, which then must not fork.
    """
    methods = usable_samplers(plan, headless=headless)
    apart = compiled_kernels() < ENOUGH_KERNELS and not beside and ADAPTIVE in methods
    second = _second_compiler(plan) if apart else nullcontext()
    stages = _Stages(say)
    with locked(cache_root() / "lock", LONGEST_OTHERS_S), second, when_compiling(stages.compiles):
        for method in methods:
            stages.begin(method)
            _one_pixel_block(plan, tracer_scene, method)
        stages.begin("compositing")
        _layers(plan, tracer_scene)
        _operators(plan)
        _between(plan)


class _Stages:
    """Says of each stage that its kernels are loaded, or compiled: from the first that the cache lacks."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self._doing, self._stage = say, "loading", ""

    def begin(self, stage: str) -> None:
        self._stage = stage
        self._say(f"{self._doing} kernels ({stage})")

    def compiles(self) -> None:
        if self._doing == "loading":
            self._doing = "compiling"
            self.begin(self._stage)


@contextmanager
def _second_compiler(plan: Plan) -> Iterator[None]:
    """Compile compositors' kernels in a process beside this one, which finds them in the cache when it comes to them.

    Whatever the other process did not reach, or failed at, is compiled here.
    """
    if len(os.sched_getaffinity(0)) < 2:
        yield
        return
    process = multiprocessing.get_context("fork").Process(target=_made_up_blocks, args=(plan,), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


def _made_up_blocks(plan: Plan) -> None:
    """The way of a few samples behind the ray tracer, for one view of each kind."""
    for rank, region in _one_of_each_kind(plan):
        _made_up_block(plan, rank, region)


def _one_of_each_kind(plan: Plan) -> list[tuple[int, Region]]:
    """A region, and its renderer, of a view with each integrator, with a lens and without."""
    found: dict[int, tuple[int, Region]] = {}
    for rank in plan.layout.renderers():
        for region in plan.layout.regions_of(rank):
            found.setdefault(id(plan.scene_of(region.view)), (rank, region))
    return list(found.values())


def _made_up_block(plan: Plan, rank: int, region: Region) -> None:
    """Encode, decode, insert, reconstruct, compare."""
    layout, wanted = plan.layout, needs(plan.scene_of(region.view))
    samples = np.zeros(TINY.area, SAMPLE)
    samples["xy"] = np.argwhere(np.ones((TINY.height, TINY.width))) + 0.5
    samples["depth"], samples["radiance"] = 1.0, 0.5
    event = replace(first_event(plan, 0.0, region.view), sampler="adaptive")
    made_up = Batch(
        view=event.view,
        panel=region.panel,
        rect=region.rect,
        rank=rank,
        sequence=1,
        camera_event=event.camera_event,
        scene_event=event.scene_event,
        base_time=0.0,
        samples=samples,
        camera=event.camera,
        adaptive=True,
        relightable=wanted.relighting,
        noisy=wanted.paths,
    )
    batch = decode(encode(made_up, Codec[layout.config.transport.codec.upper()]))
    panel = PanelCompositor(plan, region.layer, reconstruction="cpu")
    panel.follow(event)
    for number in range(2):
        _insert(panel, batch)
        panel.refresh(event, 0.1 * number)
    panel.statistics_images(0.1)


def _insert(panel: PanelCompositor, batch: Batch) -> None:
    """Give a panel a batch, and its deep buffer too where the sampler does that."""
    panel.insert(batch)
    if batch.adaptive and panel.layer.at_renderer:
        panel.reprojected.shared().insert(batch.samples, batch.base_time, batch)


def _one_pixel_block(plan: Plan, tracer_scene: TracerScene, method: str) -> None:
    """What one view of each kind needs."""
    for rank, region in _one_of_each_kind(plan):
        _one_view(plan, tracer_scene, method, rank, region)


def _one_view(plan: Plan, tracer_scene: TracerScene, method: str, rank: int, region: Region) -> None:
    clock = ManualClock()
    worker = _tiny_worker(plan, tracer_scene, rank, region, method, clock)
    panel = PanelCompositor(plan, region.layer, reconstruction="cpu")  # no OpenGL before ranks fork
    event = replace(first_event(plan, 0.0, region.view), sampler=method)
    panel.follow(event)
    packet = worker.step(event)
    if packet:
        batch = decode(packet)
        _insert(panel, batch)
        worker.forget(batch)
    for number in range(2):  # something moved, nothing moved
        panel.refresh(event, 0.1 * number)
        clock.advance(0.1)  # so that the renderer's deep buffer is refreshed as well
        worker.step(event)
    worker.measure_tiles()
    panel.newest.buffer.oldest_sample(0.0)
    panel.statistics_images(0.0)


def _tiny_worker(
    plan: Plan, tracer_scene: TracerScene, rank: int, region: Region, method: str, clock: ManualClock
) -> Worker:
    """A renderer's only thread, with a few pixels of its region; `method` as in make_samplers."""
    tiny = replace(region, rect=TINY)
    return Worker(plan, tracer_scene, rank, clock, make_samplers(plan, method, tiny, clock), 0, tiny)


def _layers(plan: Plan, tracer_scene: TracerScene) -> None:
    """Layers that bring more than display bytes, one of each kind, and their way from one moment to another."""
    layout, known = plan.layout, set()
    for layer in layout.graph.layers:
        step = layout.graph.step(layer.node)
        scene, apart = plan.scene_of(layer.view), (layer.scale < 1.0, layer.refresh_hz is not None)
        kind = (step.channels, step.encoded, layer.transparent, layer.reprojects, id(scene), apart)
        if kind in known or (step.encoded and step.channels == {"colour"} and not any(apart)):
            continue
        known.add(kind)
        panel = PanelCompositor(plan, layer.index, reconstruction="cpu")
        event = first_event(plan, 0.0, layer.view)
        rank = layer.ranks[0]
        region = next(region for region in layout.regions_of(rank) if region.layer == layer.index)
        worker = _tiny_worker(plan, tracer_scene, rank, region, "", ManualClock())
        panel.follow(event)
        if packet := worker.step(event):
            panel.insert(decode(packet))
        panel.refresh(event, 0.0)
        if layer.refresh_hz is not None:
            x, y, z = event.camera.position
            camera = replace(event.camera, position=(x, y + 1e-3, z))
            panel.refresh(
                replace(event, camera_event=event.camera_event + 1, camera=camera), 0.0
            )  # not reconstructed yet, but moved
        if panel.framelet.depth is not None:
            Timewarp(plan)(panel.framelet, event, layer.panel)


def _operators(plan: Plan) -> None:
    """Each kind of node of the graph on a few pixels, where that says anything about the whole."""
    graph, known = plan.layout.graph, set()
    for step in graph.steps:
        inputs = [graph.steps[k] for k in step.inputs]
        kind = (type(step.node), step.channels, step.encoded, *((i.channels, i.encoded) for i in inputs[:2]))
        if not isinstance(step.node, Operator) or kind in known:
            continue
        known.add(kind)
        rect = replace(step.rect, width=min(8, step.rect.width), height=min(8, step.rect.height))
        if not all(i.rect.contains(rect) for i in inputs):
            continue
        given = [Framelet.blank(rect, i.channels, encoded=i.encoded, order=i.order) for i in inputs]
        for framelet in given:
            if framelet.alpha is not None:
                framelet.alpha[...] = 0.5  # covered in part: what `depth` does with that too
        out = Framelet.blank(rect, step.channels, encoded=step.encoded and not step.computes)
        try:
            prepared = step.node.prepare(plan.layout.loaded.folder, [rect for _ in inputs])
        except ConfigError:  # a file that fits nothing but the whole; those that fit nothing were refused before
            continue
        step.node.apply(given, out, rect, prepared)


def _between(plan: Plan) -> None:
    """What stands beside nodes: skies, clicks, light to display bytes, the way of a framelet to another process."""
    graph = plan.layout.graph
    for step in graph.steps:
        if isinstance(step.node, SkyNode):
            SkyLayer(plan, step).refresh(first_event(plan, 0.0), 0.0)
            break
    few = Rect(x=0, y=0, width=8, height=8)
    if graph.has_sink("browser"):  # what a click asks
        Picking(plan.scene).distance(plan.scene.at(0.0), np.zeros(3), np.array([0.0, 0.0, -1.0]))
    light = Framelet.blank(few, frozenset({"colour", "depth"}))
    shown = np.zeros((8, 8, 3), np.uint8)
    kernels.encode(light.colour, 0, 0, srgb_curve(), shown, 0, 0, 8, 8)
    tiles = changed_tiles(shown, shown.copy())
    if graph.has_sink("browser"):  # what its page is sent
        exact_tiles(shown, tiles)
        take_visible(shown, shown.copy(), TILE, np.uint8(0), tiles)
    if graph.compositors > 1 or any(layer.at_renderer for layer in graph.layers):
        FrameletPart.of(0, light, few).write(light)
