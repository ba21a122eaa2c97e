"""What a process does as one rank of a wall: it makes a role and the ways to others, and runs the loop."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

from wall.core.clock import Clock
from wall.core.data import Batch
from wall.display.base import Sink
from wall.packets.control import Hello
from wall.roles.composition import RunAll, one_by_one
from wall.roles.compositor import Compositor
from wall.roles.config_edits import text_of
from wall.roles.instructions import Role, Trace
from wall.roles.plan import HEAD, Plan
from wall.roles.renderer import Renderer
from wall.roles.renderer_image import image_at
from wall.run.bootstrap import Bootstrap
from wall.run.bootstrap_local import LocalBootstrap
from wall.run.clock import HeadClock
from wall.run.endings import EndSignals, WriterApart, leave_to_head
from wall.run.event_file import EventFile
from wall.run.joined import JoinedBootstrap
from wall.run.loop import Loop, OnShown, Source
from wall.run.ports import Ports
from wall.run.recording import RecordedClock, RecordedPorts, file_of
from wall.run.sinks import distinct, lay_out, make_sinks, notes_of, page_answers, save_images, window_input_of
from wall.run.succession import Preparer, Succession
from wall.run.tracers import OnTraced, Tracers
from wall.run.turns import Turns
from wall.tracing.tracer_scene import TracerScene
from wall.transport.base import Hub, Link
from wall.transport.curve import Keys
from wall.transport.factory import connect, open_hub
from wall.transport.shared_memory import machine_id

RENDERER_NICE = 5  # renderers share this machine's cores with the head: showing comes before tracing
EVENT_POLL_S = 0.02  # how long an event may wait at a compositor, which sleeps until samples come


def serve(
    plan: Plan,
    tracer_scene: TracerScene,
    bootstrap: Bootstrap,
    preparer: Preparer,
    *,
    headless: bool,
    out: Path,
    record: Path | None = None,
    sources: Sequence[Source] = (),
    turns: Turns | None = None,
) -> None:
    """Be a rank other than the head, until the manager says stop.

    `preparer`: of configurations that follow; `out`: folder for files of sinks here; `record`: folder for what
    renderers are told; `sources`: of what a renderer is told by other ways than the network; `turns`: that it takes.
    """
    rank, address = bootstrap.rank, json.loads(bootstrap.broadcast(""))
    if "number" in address:
        plan, tracer_scene = preparer.make(address["number"], address["text"], address["path"])
        plan = replace(plan, since=address["since"])
    if bootstrap.killed_soon:
        leave_to_head()
    if plan.layout.role(rank) == "renderer":
        if isinstance(bootstrap, LocalBootstrap | JoinedBootstrap):
            os.nice(RENDERER_NICE)
        file = file_of(record, rank, address.get("life", 0)) if record is not None else None
        _render(plan, tracer_scene, bootstrap, address, preparer, file, sources, turns)
    else:
        _compose(plan, bootstrap, address, preparer, out, headless=headless)


def told_again(address: Mapping[str, str], plan: Plan, *, life: int) -> str:
    """What a rank is told that is started again: `address`, and the run's configuration by now where it is another.

    `life`: how often it was started before.
    """
    told: dict[str, object] = {**address, "life": life}
    if plan.number:
        loaded = plan.layout.loaded
        told |= {"number": plan.number, "since": plan.since, "text": text_of(loaded.config), "path": str(loaded.path)}
    return json.dumps(told)


def _render(
    plan: Plan,
    tracer_scene: TracerScene,
    bootstrap: Bootstrap,
    address: Mapping[str, str],
    preparer: Preparer,
    record: Path | None,
    sources: Sequence[Source],
    turns: Turns | None,
) -> None:
    """`record`: a file that keeps all that it is told; then its workers take turns, so that there is one order."""
    rank, keys, life = bootstrap.rank, bootstrap.keys, int(address.get("life", 0))
    key = bootstrap.key if isinstance(bootstrap, JoinedBootstrap) else ""
    head_clock, hello = HeadClock(), hello_of(rank, "", key)
    clock: Clock = head_clock
    traced: OnTraced | None = None
    with ExitStack() as closing:
        if record is None:
            ports = ways_of(plan, bootstrap, address, head_clock, None)
        else:
            events = EventFile(record)
            events.cores(plan.cores)
            closing.callback(events.close)
            clock, traced = RecordedClock(head_clock, events), partial(_keep, events)
            heartbeat_s = plan.layout.config.transport.heartbeat_s
            ports = RecordedPorts(
                hello, head_clock, *_manager_of(plan, bootstrap, address), events, keys=keys, heartbeat_s=heartbeat_s
            )
        closing.callback(ports.close)

        def make(plan: Plan, tracer_scene: TracerScene, before: Role | None) -> tuple[Renderer, Tracers]:
            image = image_at(plan, rank, ports.ready, clock, ports.shares)
            if isinstance(before, Renderer) and image is not None and before.image is not None:
                image.composition.begin_with(before.image.composition)
            tracers = Tracers(
                plan, tracer_scene, rank, clock, threads=record is None, image=image, traced=traced, life=life
            )
            renderer = Renderer(plan, hello, ports.ready, image)
            if isinstance(before, Renderer):
                renderer.standing.succeed(before.standing)
            return renderer, tracers

        renderer, tracers = make(plan, tracer_scene, None)
        succession = Succession(rank, preparer, make)
        loop = Loop(renderer, ports, clock, tracers=tracers, sources=sources, succession=succession)
        loop.turns = turns
        closing.callback(loop.close)
        loop.run()


def _keep(events: EventFile, number: int, trace: Trace, result: bytes | Batch | None) -> None:
    events.batch(number, result)


def _compose(
    plan: Plan, bootstrap: Bootstrap, address: Mapping[str, str], preparer: Preparer, out: Path, *, headless: bool
) -> None:
    rank, clock = bootstrap.rank, HeadClock()
    with ExitStack() as closing:
        hub = open_data_hub(plan, bootstrap.keys)
        ports = ways_of(plan, bootstrap, address, clock, hub)
        closing.callback(ports.close)
        sinks, browser = make_sinks(plan, rank, out, headless=headless, again="life" in address)
        ports.answer_page = page_answers(sinks)
        for sink in distinct(sinks):
            closing.callback(sink.close)
        if bootstrap.killed_soon:
            apart = WriterApart(partial(save_images, distinct(sinks)))
            closing.callback(apart.wait)
            EndSignals(lambda reason: apart.begin()).install()
        hello, notes = hello_of(rank, hub.endpoint), notes_of(sinks)
        if browser is not None:
            hello, notes = replace(hello, page=browser.address, watch=browser.watch_address), (*notes, *browser.notes)
        for note in notes:
            ports.note("warning", note)
        sources = [window_input_of(rank, sinks, address.get("key", ""))]
        compositor_loop(plan, hello, hub, ports, clock, sinks, preparer, sources).run()


def compositor_loop(
    plan: Plan,
    hello: Hello,
    hub: Hub,
    ports: Ports,
    clock: HeadClock,
    sinks: list[Sink | None],
    preparer: Preparer,
    sources: Sequence[Source] = (),
    shown: OnShown | None = None,
) -> Loop:
    """A compositor, at the head or elsewhere; `shown` is told of what its sinks are given."""
    rank = hello.rank
    sink_of = dict(zip((step.node.id for step in plan.layout.graph.sinks_on(rank)), sinks, strict=True))

    def make(plan: Plan) -> Compositor:
        ports.expect([step.rank for step in plan.layout.graph.steps])
        run_all = in_threads(len(plan.layout.graph.layers_on(rank)))
        return Compositor(plan, hello, ports.ready, run_all, ports.shares)

    def follow(plan: Plan, tracer_scene: TracerScene, before: Role) -> tuple[Compositor, None]:
        assert isinstance(before, Compositor)
        sinks[:] = [sink_of[step.node.id] for step in plan.layout.graph.sinks_on(rank)]  # the loop's, in this order
        lay_out(plan, sinks)
        compositor = make(plan)
        compositor.composition.begin_with(before.composition)
        compositor.standing.succeed(before.standing)
        compositor.run_began = before.run_began
        return compositor, None

    return Loop(
        make(plan), ports, clock, sinks=sinks, sources=sources, longest_wait_s=EVENT_POLL_S, shown=shown,
        succession=Succession(rank, preparer, follow),
    )  # fmt: skip


def ways_of(plan: Plan, bootstrap: Bootstrap, address: Mapping[str, str], clock: HeadClock, hub: Hub | None) -> Ports:
    """A rank's ways to others. Processes of one machine share its monotonic clock and need no pings."""
    manager, ping_s = _manager_of(plan, bootstrap, address)
    return Ports(
        bootstrap.rank, clock, hub=hub, manager=manager, ping_s=ping_s, keys=bootstrap.keys,
        heartbeat_s=plan.layout.config.transport.heartbeat_s, asks=not isinstance(bootstrap, LocalBootstrap),
    )  # fmt: skip


def _manager_of(plan: Plan, bootstrap: Bootstrap, address: Mapping[str, str]) -> tuple[Link, float | None]:
    """A link to the manager, and how often it is asked for the time; None where its clock is ours."""
    ping_s = None if address["machine"] == machine_id() else plan.layout.config.transport.heartbeat_s
    return connect(address["manager"], rank=bootstrap.rank, keys=bootstrap.keys, to=HEAD), ping_s


def hello_of(rank: int, endpoint: str, key: str = "") -> Hello:
    """What this process says of itself; `endpoint`: where others send packets to; `key`: of one that has joined."""
    incarnation = int.from_bytes(os.urandom(6), "little")
    return Hello(rank=rank, host=socket.gethostname(), endpoint=endpoint, incarnation=incarnation, key=key)


def open_data_hub(plan: Plan, keys: Keys | None, *, again: str = "") -> Hub:
    """A hub as the configuration wants it, for those who have keys; `again`: the endpoint that it had before."""
    transport = plan.layout.config.transport
    ports = transport.port_range
    if again:
        ports = (int(again.rpartition(":")[2]),) * 2
    return open_hub(
        transport.kind, transport.bind, credit_bytes=transport.credit_bytes, keys=keys, ports=ports,
        allow=transport.allow,
    )  # fmt: skip


def in_threads(layers: int) -> RunAll:
    """Refresh several layers at once, a core each: kernels release the GIL, and layers share no written array."""
    workers = min(layers, len(os.sched_getaffinity(0)))
    if workers < 2:
        return one_by_one
    pool = ThreadPoolExecutor(workers, thread_name_prefix="refresh")
    return lambda refreshes: list(pool.map(lambda refresh: refresh(), refreshes))
