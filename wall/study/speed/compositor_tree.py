"""Streams of samples from several ranks: two compositors before the head, against a head that takes all in itself."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path

from wall.config.loading import loads
from wall.core.data import Event
from wall.packets.samples import decode
from wall.roles.composition import Composition
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan
from wall.roles.worker import Worker, make_samplers
from wall.run.clock import HeadClock
from wall.study.speed.record import Row, compared, median
from wall.tracing.tracer_scene import make_tracer_scene
from wall.transport.zeromq import ZmqHub, ZmqLink

PIXELS, COLUMNS = (480, 270), 4
PACKETS, DIFFERENT = 250, 8  # that a source sends; they repeat
CREDIT_BYTES = 1 << 18
REFRESH_S = 1.0 / 30.0
PATIENCE_S = 60.0


def measure(rounds: int) -> list[Row]:
    """Samples a second from eight sources into one image of the wall."""
    ratios: dict[int, list[float]] = {}
    for sources in (4, 8):
        plans = [_plan(sources, tree=tree) for tree in (False, True)]
        packets = [_packets(plan) for plan in plans]
        turns = [[_rate(*pair) / 1e6 for pair in zip(plans, packets, strict=True)] for _ in range(max(3, rounds // 2))]
        one, tree = ([turn[k] for turn in turns] for k in range(2))
        ratios[sources] = [b / a for a, b in turns]
    note = (
        f"eight frameless streams as fast as they are taken in, {PIXELS[0]}x{PIXELS[1]} each, refreshed at 30 Hz; two "
        f"compositors and the head against the head alone, on {len(os.sched_getaffinity(0))} cores"
    )
    more = {"ratio_of_4_sources": round(median(ratios[4]), 3)}
    return [compared("compositor_tree", tree, one, unit="M samples/s", at_least=1.0, note=note, **more)]


def _plan(sources: int, *, tree: bool) -> Plan:
    """One rank a panel. The head makes all framelets, or two compositors make half of them each."""
    rows, half, first = sources // COLUMNS, sources // 2, 3 if tree else 1
    nodes, names = [], [f"p{k}" for k in range(sources)]
    for k in range(sources):
        node = f"compositor {1 + k // half}" if tree else "head"
        nodes.append(f"{{id: s{k}, op: samples, panel: r{k // COLUMNS}c{k % COLUMNS}, rank: {first + k}}}")
        nodes.append(f"{{id: p{k}, op: reconstruct, input: s{k}, on: {node}}}")
    for k, part in enumerate((names[:half], names[half:])):  # where its inputs are
        nodes.append(f"{{id: half{k}, op: tile, inputs: [{', '.join(part)}]}}")
    nodes.append("{id: wall, op: tile, inputs: [half0, half1], on: head}")
    nodes.append("{id: files, op: sink, kind: png, input: wall}")
    text = (
        "version: 1\nscene: {source: courtyard}\n"
        "views: [{camera: {position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}}]\n"
        f"wall: {{grid: {{columns: {COLUMNS}, rows: {rows}, pixels: [{PIXELS[0]}, {PIXELS[1]}], size: [0.48, 0.27]}}}}"
        "\n"
        f"graph:\n  compositors: {first}\n  nodes:\n" + "".join(f"  - {node}\n" for node in nodes)
    )
    return make_plan(make_layout(loads(text, name="measure", path=Path("measure.yaml"))))


def _packets(plan: Plan) -> dict[int, list[bytes]]:
    """Some packets of every renderer, by its rank."""
    tracer_scene, clock, event = make_tracer_scene(plan.scene), HeadClock(), first_event(plan, 0.0)
    found = {}
    for rank in plan.layout.renderers():
        worker = Worker(plan, tracer_scene, rank, clock, make_samplers(plan, "", plan.layout.region(rank), clock), 0)
        found[rank] = [packet for _ in range(DIFFERENT) if (packet := worker.step(event)) is not None]
    return found


def _rate(plan: Plan, packets: dict[int, list[bytes]]) -> float:
    """Samples a second, from the first packet until the head's image has the last one."""
    graph, context = plan.layout.graph, multiprocessing.get_context("fork")
    hub, event = ZmqHub("127.0.0.1", credit_bytes=CREDIT_BYTES), first_event(plan, 0.0)
    endpoints, children, pipes = {HEAD: hub.endpoint}, [], []
    try:
        for compositor in range(1, graph.compositors):
            ours, theirs = context.Pipe()
            children.append(
                context.Process(target=_compositor, args=(plan, compositor, hub.endpoint, theirs), daemon=True)
            )
            children[-1].start()
            endpoints[compositor] = ours.recv()
            pipes.append(ours)
        feeds = {rank: (endpoints[graph.layer_of(rank).compositor], packets[rank]) for rank in plan.layout.renderers()}
        children.append(context.Process(target=_feed, args=(feeds,), daemon=True))
        head = _Intake(plan, HEAD, hub, {})
        head.composition.follow(event)
        children[-1].start()
        began = time.perf_counter()
        _run(head, event, PACKETS * sum(layer.compositor == HEAD for layer in graph.layers))
        while not all(pipe.poll() for pipe in pipes) and time.perf_counter() - began < PATIENCE_S:
            head.refresh(event, time.perf_counter() + REFRESH_S)
        head.refresh(event, time.perf_counter())
        seconds = time.perf_counter() - began
    finally:
        for child in children:
            child.kill()
            child.join(5.0)
        hub.close()
    samples = sum(len(decode(packet).samples) for made in packets.values() for packet in made)
    return samples * PACKETS / DIFFERENT / seconds


class _Intake:
    """A composition, fed from a hub; `links` lead to ranks that need its framelets."""

    def __init__(self, plan: Plan, rank: int, hub: ZmqHub, links: Mapping[int, ZmqLink]) -> None:
        self.composition = Composition(plan, rank, lambda target: links[target].ready())
        self.packets, self._hub, self._links = 0, hub, links

    def take_in(self) -> bool:
        """Insert what has come. Returns whether anything had."""
        came = self._hub.drain(1 << 20)
        for peer, packet in came:
            self.composition.insert(packet)
            self._hub.release(peer, len(packet))
        self.packets += len(came)
        return bool(came)

    def send(self) -> None:
        """Send what other ranks need, as far as there is credit."""
        for offer in self.composition.send():
            for dropped in self._links[offer.to].offer(offer.packet):
                self.composition.lose(offer.to, dropped)

    def refresh(self, event: Event, due: float, packets: int = 1 << 62) -> None:
        """Take in what comes until a refresh is due, and refresh."""
        while time.perf_counter() < due and self.packets < packets:
            if not self.take_in():
                self._hub.wait(0.002)
            self.send()
        self.take_in()
        self.composition.refresh(event, HeadClock().now())
        self.send()


def _run(compositor: _Intake, event: Event, packets: int) -> None:
    """Take so many packets in, refreshing and sending on as often as a display would."""
    limit = time.perf_counter() + PATIENCE_S
    while compositor.packets < packets and time.perf_counter() < limit:
        compositor.refresh(event, time.perf_counter() + REFRESH_S, packets)
    while not compositor.composition.idle and time.perf_counter() < limit:
        compositor.send()


def _compositor(plan: Plan, rank: int, head: str, pipe: Connection) -> None:
    """One before the head: says when all is taken in and sent on, and waits to be killed."""
    parent, event = os.getppid(), first_event(plan, 0.0)
    hub = ZmqHub("127.0.0.1", credit_bytes=CREDIT_BYTES)
    compositor = _Intake(plan, rank, hub, {HEAD: ZmqLink(head, rank=rank)})
    compositor.composition.follow(event)
    pipe.send(hub.endpoint)
    _run(compositor, event, PACKETS * len(compositor.composition.layers))
    pipe.send("done")
    while os.getppid() == parent:
        time.sleep(0.01)


def _feed(feeds: Mapping[int, tuple[str, list[bytes]]]) -> None:
    """All sources: each sends its packets as there is credit, until it has sent PACKETS of them."""
    parent = os.getppid()
    links = {rank: ZmqLink(endpoint, rank=rank) for rank, (endpoint, _) in feeds.items()}
    sent = dict.fromkeys(feeds, 0)
    while os.getppid() == parent:
        ready = [rank for rank, link in links.items() if link.ready() and sent[rank] < PACKETS]
        for rank in ready:
            links[rank].offer(feeds[rank][1][sent[rank] % DIFFERENT])
            sent[rank] += 1
        if not ready:
            time.sleep(0.0005)
