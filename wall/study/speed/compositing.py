"""What compositing costs: `depth` against a copy of as many bytes, an unchanged input, a tree of compositors.

Depth layers come from eight processes: two compositors before a third one, against one that takes all. What a tree
costs: a framelet is compressed, sent and opened once more. What it saves: the first compositors work at the same time,
each on half of the layers.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from wall.compositing.executor import Executor
from wall.compositing.graph import Graph
from wall.config.loading import loads
from wall.core.data import BLANK, Framelet, Rect
from wall.geometry.panels import Panel
from wall.operators.depth import Depth
from wall.packets.control import parse_control, serialise
from wall.packets.framelets import FrameletPart, bytes_a_pixel
from wall.roles.edges import Outlets, RemoteFramelet, needed_from_others
from wall.roles.plan import Plan, first_event, make_layout
from wall.study.speed.record import SEED, Row, bounded, compared, median, reported
from wall.study.speed.tracing import plan_of
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene
from wall.transport.zeromq import ZmqHub, ZmqLink

FULL_HD = (1920, 1080)
SOURCES, SOURCE_PIXELS = 8, (960, 540)
FRAMES, SETTLING = 8, 2  # images in a round, after some that do not count
CREDIT_BYTES = 1 << 14  # one framelet under way from each source
CHANNELS = frozenset({"colour", "depth", "alpha", "object_id"})
PATIENCE_S = 60.0  # for a process that should answer within one second


def depth_copy(rounds: int) -> list[Row]:
    """GB/s of `depth` over two 1080p framelets, read and written, against a plain copy of as many bytes."""
    values, limits = _depth(rounds, covering=False)
    note = "two 1920x1080 framelets of random depths, one core, against one memcpy of as many bytes read and written"
    opaque = compared("depth_copy", values, limits, unit="GB/s", at_least=0.6, note=note)
    values, limits = _depth(rounds, covering=True)
    ratio = round(median([value / limit for value, limit in zip(values, limits, strict=True)]), 3)
    note = "the same where each pixel of either is covered whole or not at all, as most of a sort-last layer is"
    return [opaque, reported("depth_covered", median(values), unit="GB/s", note=note, ratio_to_copy=ratio)]


def _depth(rounds: int, *, covering: bool) -> tuple[list[float], list[float]]:
    """GB/s of the operator, and of the copy, in turn."""
    random = np.random.default_rng(SEED)
    rect = Rect(x=0, y=0, width=FULL_HD[0], height=FULL_HD[1])
    size = (rect.height, rect.width)
    channels = frozenset({"colour", "depth", "alpha"} if covering else {"colour", "depth"})
    inputs = [Framelet.blank(rect, channels) for _ in range(2)]
    for framelet in inputs:
        framelet.colour[...] = random.random((*size, 3), np.float32)
        framelet.channel("depth")[...] = random.random(size, np.float32)
        if covering:
            framelet.channel("alpha")[...] = random.random(size) < 0.5
            framelet.colour[...] *= framelet.channel("alpha")[..., None]
    out = Framelet.blank(rect, channels)
    node = Depth(op="depth", id="depth", inputs=("a", "b"))
    moved = 3 * bytes_a_pixel(channels, encoded=False) * rect.area  # two read, one written
    source = np.ones(moved // 2, np.uint8)
    target = np.zeros_like(source)
    node.apply(inputs, out, rect, None)
    values, limits = [], []
    for _ in range(rounds):
        began = time.perf_counter()
        np.copyto(target, source)
        between = time.perf_counter()
        node.apply(inputs, out, rect, None)
        done = time.perf_counter()
        limits.append(moved / (between - began) / 1e9)
        values.append(moved / (done - between) / 1e9)
    return values, limits


def unchanged_input(rounds: int) -> list[Row]:
    """Pixels that the nodes after eight unchanged sources write at a refresh."""
    graph = layered_graph(tree=False)
    sources = {s.index: Framelet.blank(s.rect, s.channels) for s in needed_from_others(graph, 0)}
    executor = Executor(graph, 0, sources, Path())
    executor.step({k: [f.rect] for k, f in sources.items()}, None)
    written, began = executor.pixels, time.perf_counter()
    for _ in range(1000 * rounds):
        executor.step({}, None)
    micros = 1e6 * (time.perf_counter() - began) / (1000 * rounds)
    note = f"eight sources, depth and a sink; {micros:.0f} us a refresh to find that nothing changed"
    pixels = float(executor.pixels - written)
    return [bounded("unchanged_input", pixels, 0.0, unit="pixels", below=True, note=note, micros=round(micros, 2))]


def depth_tree(rounds: int) -> list[Row]:
    """Images a second of eight depth layers: two compositors before a third one, against one that takes all."""
    layers = _layers()
    one, two = [], []
    for _ in range(max(2, rounds // 3)):
        one.append(_images_a_second(layered_graph(tree=False), layers))
        two.append(_images_a_second(layered_graph(tree=True), layers))
    note = (
        f"courtyard cut into {SOURCES} layers of {SOURCE_PIXELS[0]}x{SOURCE_PIXELS[1]} with depth, alpha and object, "
        f"every one new for every image; three processes against one, on {len(os.sched_getaffinity(0))} cores"
    )
    ratio = median([b / a for a, b in zip(one, two, strict=True)])
    more = {"one": round(median(one), 2), "ratio_to_one": round(ratio, 3)}
    return [reported("depth_tree", median(two), unit="images/s", note=note, **more)]


def layered_graph(*, tree: bool) -> Graph:
    """Eight layers, each made on a rank of its own; put together on the head, or in halves on 1 and 2 first."""
    width, height = SOURCE_PIXELS
    first, half, names = 3 if tree else 1, SOURCES // 2, [f"f{k}" for k in range(SOURCES)]
    nodes = []
    for k, name in enumerate(names):
        nodes.append(f"{{id: s{k}, op: samples, panel: r0c0, range: [{k / SOURCES}, {(k + 1) / SOURCES}]}}")
        where = f"compositor {first + k}"
        nodes.append(f"{{id: {name}, op: reconstruct, input: s{k}, background: transparent, on: {where}}}")
    if tree:
        nodes.append(f"{{id: d1, op: depth, inputs: [{', '.join(names[:half])}], on: compositor 1}}")
        nodes.append(f"{{id: d2, op: depth, inputs: [{', '.join(names[half:])}], on: compositor 2}}")
    nodes.append(f"{{id: all, op: depth, inputs: [{'d1, d2' if tree else ', '.join(names)}], on: head}}")
    nodes.append("{id: files, op: sink, kind: png, input: all}")
    text = (
        "version: 1\nscene: {source: courtyard}\nviews: [{camera: auto}]\n"
        f"wall: {{grid: {{columns: 1, rows: 1, pixels: [{width}, {height}], size: [0.96, 0.54]}}}}\n"
        f"graph:\n  compositors: {first + SOURCES}\n  nodes:\n" + "".join(f"  - {node}\n" for node in nodes)
    )
    return make_layout(loads(text, name="measure")).graph


def _layers() -> list[Framelet]:
    """What each source of `layered_graph` has: its share of the objects, traced once a pixel."""
    plan = plan_of("courtyard", SOURCE_PIXELS)
    panel, tracer_scene = plan.layout.wall.panels[0], make_tracer_scene(plan.scene)
    layers = []
    for k in range(SOURCES):
        seen = plan.scene.objects_in((k / SOURCES, (k + 1) / SOURCES))
        layers.append(_traced(plan, panel, Tracer(tracer_scene, panel, plan.view.eye, coherent=True, seen=seen)))
    return layers


def _traced(plan: Plan, panel: Panel, tracer: Tracer) -> Framelet:
    width, height = panel.pixels
    event = first_event(plan, 0.0)
    tracer.set_event(event)
    xy = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2) + 0.5
    samples = tracer.trace(xy.astype(np.float32))[0]
    rect = Rect(x=0, y=0, width=width, height=height)
    framelet = replace(Framelet.blank(rect, CHANNELS), event=event)
    rows, columns = samples["xy"][:, 1].astype(int), samples["xy"][:, 0].astype(int)
    hit = samples["object_id"] > 0
    framelet.colour[rows, columns] = samples["radiance"] * hit[:, None]
    for name, values in (("depth", samples["depth"]), ("alpha", hit), ("object_id", samples["object_id"])):
        framelet.channel(name)[rows, columns] = np.where(hit, values, BLANK[name][0])
    return framelet


class _Compositor:
    """One compositor of `layered_graph`: takes framelets in, does its nodes, sends the head what came of them."""

    def __init__(self, graph: Graph, rank: int) -> None:
        self._graph, self._rank = graph, rank
        self.hub = ZmqHub("127.0.0.1", credit_bytes=CREDIT_BYTES)
        self._remote = {step.index: RemoteFramelet(step) for step in needed_from_others(graph, rank)}
        self._executor = Executor(graph, rank, {k: far.framelet for k, far in self._remote.items()}, Path())
        self._link: ZmqLink | None = None
        self._outlets: Outlets | None = None

    def send_to(self, head: str) -> None:
        self._link = ZmqLink(head, rank=self._rank)
        link = self._link
        self._outlets = Outlets(self._graph, self._rank, lambda target: link.ready())

    def image(self) -> None:
        """Wait for a new framelet of every source, then make, and send, what comes of them."""
        came: set[int] = set()
        limit = time.monotonic() + PATIENCE_S
        while len(came) < len(self._remote) and time.monotonic() < limit:
            for peer, packet in self.hub.drain(1):
                part = parse_control(packet)
                assert isinstance(part, FrameletPart)
                self._remote[part.step].insert(part)
                came.add(part.step)
                self.hub.release(peer, len(packet))
            self.hub.wait(0.005)
        changes = self._executor.step({k: far.take_changes() for k, far in self._remote.items()}, None)
        if self._outlets is None or self._link is None:
            return
        self._outlets.add(changes)
        while not self._outlets.idle and time.monotonic() < limit:
            for offer in self._outlets.send(self._executor.framelets, lambda view: (0, 0)):
                self._link.offer(offer.packet)  # credit was there: nothing gives way
            self._link.wait(0.001)


def _images_a_second(graph: Graph, layers: list[Framelet]) -> float:
    """Of the head, with all that comes before it in processes of their own."""
    context = multiprocessing.get_context("fork")
    ranks = sorted({step.rank for step in graph.steps if isinstance(step.node, Depth)} - {0})
    sources = {graph.step(f"f{k}").index: layer for k, layer in enumerate(layers)}
    packets = {k: serialise(FrameletPart.of(k, layer, layer.rect)) for k, layer in sources.items()}
    pipes = {rank: context.Pipe() for rank in (*ranks, -1)}
    children = [context.Process(target=_leaf, args=(graph, p, pipes[p][1]), daemon=True) for p in ranks]
    children.append(context.Process(target=_feed, args=(packets, pipes[-1][1]), daemon=True))
    for child in children:
        child.start()
    head = _Compositor(graph, 0)
    try:
        endpoints = {0: head.hub.endpoint}
        for rank in ranks:
            pipes[rank][0].send(head.hub.endpoint)
            endpoints[rank] = pipes[rank][0].recv()
        users = {k: graph.steps[graph.steps[k].users[0]].rank for k in packets}
        pipes[-1][0].send({k: endpoints[rank] for k, rank in users.items()})
        for _ in range(SETTLING):
            head.image()
        began = time.perf_counter()
        for _ in range(FRAMES):
            head.image()
        return FRAMES / (time.perf_counter() - began)
    finally:
        for child in children:
            child.kill()
            child.join(5.0)
        head.hub.close()


def _leaf(graph: Graph, rank: int, pipe: Connection) -> None:
    """A compositor before the head, until it is killed or alone."""
    parent, compositor = os.getppid(), _Compositor(graph, rank)
    compositor.send_to(pipe.recv())
    pipe.send(compositor.hub.endpoint)
    while os.getppid() == parent:
        compositor.image()


def _feed(packets: dict[int, bytes], pipe: Connection) -> None:
    """All sources: each sends its framelet whenever the last one has been taken in."""
    parent = os.getppid()
    links = {step: ZmqLink(endpoint, rank=step) for step, endpoint in pipe.recv().items()}
    while os.getppid() == parent:
        ready = [step for step, link in links.items() if link.ready()]
        for step in ready:
            links[step].offer(packets[step])
        if not ready:
            time.sleep(0.001)
