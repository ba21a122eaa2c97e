"""Measure what work costs on this machine, with the code of a run: see rates.py for what is found.

It is a run of the plan's renderers, in processes of their own, and of a head, in which every batch, packet and refresh
is timed: costs depend on how dense samples are, and on what shares the cores and their caches. All of it is CPU time,
so what else the machine does counts little.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from importlib.util import find_spec
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, cast

import lz4.block
import numpy as np

from wall.compositing.executor import Changes
from wall.core.clock import ManualClock
from wall.core.data import Event
from wall.core.errors import ConfigError, RunError, WallError
from wall.packets.control import Heartbeat, Message, parse_control, serialise
from wall.roles.adaptive_renderer import AdaptiveRenderer
from wall.roles.composition import Composition
from wall.roles.compositor import Compositor
from wall.roles.director import Director
from wall.roles.instructions import MANAGER, Trace, Traced
from wall.roles.manager import EVENTS_A_REFRESH, Manager
from wall.roles.plan import HEAD, Plan, on_one_rank
from wall.roles.renderer import Renderer
from wall.roles.worker import Worker
from wall.run.clock import HeadClock
from wall.run.head import INPUT_POLL_S, ManagerThread
from wall.run.loop import Loop
from wall.run.ports import Ports
from wall.run.ranks import EVENT_POLL_S, RENDERER_NICE
from wall.run.single_process import Wire, hello_of
from wall.run.tracers import Tracers
from wall.run.warm_up import warm_up
from wall.study.plan.rates import Rates
from wall.study.quality.methods_streams import H264_METHODS, H264_PRESET, JPEG_QUALITY
from wall.study.quality.streams import H264, Bytes, Jpeg, Stream
from wall.study.speed.record import commit, machine
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene
from wall.transport.zeromq import ZmqHub, ZmqLink

MOST_RENDERERS = 64  # processes of this machine
SETTLING = 0.4  # share of the time that is not counted: deep buffers fill
MESSAGES = 200
PATIENCE_S = 30.0
IMAGES = 12
# CPU seconds, samples, bytes; whether the event was new; whether it replanned
Step = tuple[float, int, int, bool, bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """What a renderer has done since counting began."""

    steps: list[Step]
    turns: int  # of its loop
    seconds: float
    beside_s: float  # CPU time of all but the steps


def measure(plan: Plan, *, seconds: float = 5.0, say: Callable[[str], None] = lambda line: None) -> Rates:
    """Run a plan's renderers and a head, which takes in all their samples, for so long, everything timed.

    Raises ConfigError above MOST_RENDERERS, RunError where nothing came of it.
    """
    if len(plan.layout.regions) > MOST_RENDERERS:
        raise ConfigError(f"{plan.layout.loaded.path}: {len(plan.layout.regions)} renderers; wanted: {MOST_RENDERERS}")
    plan = on_one_rank(plan)
    tracer_scene = make_tracer_scene(plan.scene)
    warm_up(plan, tracer_scene, say)
    say(f"measuring for {seconds:.0f} s")
    head = _Head(plan)
    told = head.run(tracer_scene, seconds)
    found = _renderer_costs(plan, [step for one in told for step in one.steps]) | head.composition.costs()
    images = head.composition.images
    found |= _framelets(images[-1]) | _streams(images, plan.view.refresh_hz)
    found |= _sockets(plan, round(found["batch_samples"] * found["sample_bytes"]))
    found["turn_s"] = _turn_s(told, found, EVENTS_A_REFRESH * plan.view.refresh_hz)
    cores, method = len(os.sched_getaffinity(0)), plan.layout.sampling.method
    return Rates(machine=machine(), commit=commit(), method=method, cores=cores, **found)


class _TimedComposition:
    """A composition, every packet and every refresh timed."""

    def __init__(self, composition: Composition, since: float, until: float) -> None:
        """`since`, `until`: when counting begins and ends, seconds of the head's clock; at the end the view rests."""
        self._composition, self._since, self._until = composition, since, until
        self.images: list[Bytes] = []
        self._inserts, self._refreshes = list[float](), list[float]()  # CPU seconds

    def insert(self, packet: bytes, now: float = -math.inf) -> None:
        self._inserts.append(_timed(lambda: self._composition.insert(packet, now)))

    def refresh(self, event: Event, now: float, *, force: bool = False) -> Changes:
        if now < self._since:
            self._inserts.clear()
            self._refreshes.clear()
        found = list[Changes]()
        spent = _timed(lambda: found.append(self._composition.refresh(event, now, force=force)))
        if now >= self._until:
            return found[0]
        self._refreshes.append(spent)
        layer = next(iter(self._composition.layers.values()))
        self.images = [*self.images[1 - IMAGES :], np.array(layer.framelet.colour, np.uint8)]
        return found[0]

    def costs(self) -> dict[str, float]:
        """Means of all that was counted. Raises RunError where nothing was."""
        if not self._inserts or not self._refreshes:
            raise RunError("nothing came from the renderers that were measured")
        pixels = sum(layer.framelet.rect.area for layer in self._composition.layers.values())
        return {
            "insert_s": sum(self._inserts) / len(self._inserts),
            "refresh_pixel_s": sum(self._refreshes) / len(self._refreshes) / pixels,
        }

    def __getattr__(self, name: str) -> Any:
        return getattr(self._composition, name)


class _Head:
    """The manager and the head's compositor, as in a run."""

    def __init__(self, plan: Plan) -> None:
        self._plan, self._clock = plan, HeadClock()
        self.composition: _TimedComposition  # of the run

    def run(self, tracer_scene: TracerScene, seconds: float) -> list[Told]:
        """Run for so long. Returns what each renderer has done, without the beginning."""
        plan, clock, context = self._plan, self._clock, multiprocessing.get_context("fork")
        credit, children, pipes = plan.layout.config.transport.credit_bytes, [], list[Connection]()
        with ExitStack() as closing:
            control = ZmqHub("127.0.0.1", credit_bytes=credit)
            manager_ways = Ports(MANAGER, clock, hub=control)
            closing.callback(manager_ways.close)
            since, until = clock.now() + SETTLING * seconds, clock.now() + seconds
            self.composition = _TimedComposition(Composition(plan, HEAD), since, until)
            for rank in plan.layout.renderers():
                ours, theirs = context.Pipe()
                args = (plan, tracer_scene, rank, control.endpoint, theirs, since)
                children.append(context.Process(target=_render, args=args, daemon=True))
                children[-1].start()
                closing.callback(_end, children[-1])
                pipes.append(ours)
            data = ZmqHub("127.0.0.1", credit_bytes=credit)
            ways = Ports(HEAD, clock, hub=data, manager=ZmqLink(control.endpoint, rank=HEAD))
            closing.callback(ways.close)
            hello = replace(hello_of(HEAD), endpoint=data.endpoint)
            compositor = Compositor(plan, hello, ways.ready, composition=cast(Any, self.composition))
            sinks = [None] * len(self.composition.shown())
            loop = Loop(compositor, ways, clock, sinks=sinks, longest_wait_s=EVENT_POLL_S)
            manager = Manager(plan, clock.now(), still=False, seconds=seconds)
            managing = ManagerThread(Loop(manager, manager_ways, clock, longest_wait_s=INPUT_POLL_S))
            managing.start()
            loop.run(alive=managing.is_alive)
            managing.join(PATIENCE_S)
            if not all(pipe.poll(PATIENCE_S) for pipe in pipes):
                raise RunError(f"a renderer that was measured said nothing for {PATIENCE_S:.0f} s")
            return [_told(pipe.recv()) for pipe in pipes]


def _told(answer: Told | str) -> Told:
    """A renderer's answer. Raises RunError where it failed, with its words."""
    if isinstance(answer, str):
        raise RunError(f"measuring costs: {answer}")
    return answer


def _end(process: BaseProcess) -> None:
    process.kill()
    process.join(5.0)


class _TimedTracers:
    """A renderer's tracers, every batch timed."""

    def __init__(self, tracers: Tracers) -> None:
        self._tracers = tracers
        self._event: Event | None = None  # of the batch before
        self._samples = 0
        self.steps: list[Step] = []

    def start(self, trace: Trace) -> list[Traced]:
        worker, answers = self._tracers.workers[trace.worker], list[Traced]()
        replanned = _refreshes_of(worker)
        spent = _timed(lambda: answers.extend(self._tracers.start(trace)))
        packet, samples = answers[0].result, answers[0].work.samples
        if isinstance(packet, bytes) and packet:
            replans = _refreshes_of(worker) != replanned
            fresh = trace.event is not self._event
            self.steps.append((spent, samples - self._samples, len(packet), fresh or replans, replans))
        self._event, self._samples = trace.event, samples
        return answers

    def __getattr__(self, name: str) -> Any:
        return getattr(self._tracers, name)


def _render(plan: Plan, tracer_scene: TracerScene, rank: int, endpoint: str, pipe: Connection, since: float) -> None:
    """One renderer, as in a run; tells its batches when that is over, and what its loop took beside them."""
    os.nice(RENDERER_NICE)
    parent, clock = os.getppid(), HeadClock()
    ports = Ports(rank, clock, hub=None, manager=ZmqLink(endpoint, rank=rank))
    timed = _TimedTracers(Tracers(plan, tracer_scene, rank, clock))
    began, turns, counts = time.process_time(), 0, False

    def count() -> tuple[()]:
        nonlocal began, turns, counts
        turns += 1
        if not counts and clock.now() >= since:
            timed.steps.clear()
            began, turns, counts = time.process_time(), 0, True
        return ()

    renderer = Renderer(plan, hello_of(rank), ports.ready)
    try:
        Loop(renderer, ports, clock, tracers=cast(Any, timed), sources=[count]).run(lambda: os.getppid() == parent)
    except WallError as error:
        pipe.send(f"{error}; wanted: fewer renderers, or --rates FILE with costs of another machine")
    else:
        beside = time.process_time() - began - sum(step[0] for step in timed.steps)
        pipe.send(Told(steps=timed.steps, turns=turns, seconds=clock.now() - since, beside_s=beside))
    ports.close()


def _refreshes_of(worker: Worker) -> int:
    sampler = worker.sampler
    return sampler.reconstruction.refreshes if isinstance(sampler, AdaptiveRenderer) else 0


def _renderer_costs(plan: Plan, steps: Sequence[Step]) -> dict[str, float]:
    """Least squares of the batches' times over what they had to do. Raises RunError where there are none."""
    if not steps:
        raise RunError("no batch was traced while renderers were measured")
    rows = np.array(steps, np.float64)
    causes = [np.ones(len(rows)), rows[:, 3] - rows[:, 4], rows[:, 4]]
    told = [k for k, cause in enumerate(causes) if k == 0 or 0.0 < cause.mean() < 1.0]
    fitted, *_ = np.linalg.lstsq(np.column_stack([causes[k] for k in told]), rows[:, 0], rcond=None)
    batch_s, aim_s, replan_s = (max(0.0, float(fitted[told.index(k)])) if k in told else 0.0 for k in range(3))
    ranks = plan.layout.renderers()
    area = sum(plan.layout.region(rank).rect.area for rank in ranks) / len(ranks)
    samples = float(rows[:, 1].sum())
    return {
        "batch_samples": samples / len(rows),
        "batch_s": batch_s,
        "aim_s": aim_s,
        "replan_pixel_s": max(0.0, replan_s - aim_s) / area,
        "sample_bytes": float(rows[:, 2].sum()) / samples,
    }


def _timed(work: Callable[[], object]) -> float:
    began = time.thread_time()
    work()
    return time.thread_time() - began


def _framelets(image: Bytes) -> dict[str, float]:
    """An image as compositors send it: lz4 of its display bytes, see wall/packets/framelets.py."""
    pixels, raw = image.shape[0] * image.shape[1], image.tobytes()
    packed = lz4.block.compress(raw, store_size=False)
    return {
        "framelet_pixel_bytes": len(packed) / pixels,
        "pack_pixel_s": _timed(lambda: lz4.block.compress(raw, store_size=False)) / pixels,
        "unpack_pixel_s": _timed(lambda: lz4.block.decompress(packed, uncompressed_size=len(raw))) / pixels,
    }


def _streams(images: Sequence[Bytes], refresh_hz: float) -> dict[str, Any]:
    """Images of a moving view as JPEG and as H.264, as `wall measure quality` streams them."""
    size = images[0].shape[1], images[0].shape[0]
    found: dict[str, Any] = _stream("jpeg", Jpeg(JPEG_QUALITY), images)
    if find_spec("av") is None:
        return found | {"h264_pixel_bytes": None, "h264_pixel_s": None}
    crf, colour = H264_METHODS["stream_h264"]
    return found | _stream(
        "h264", H264(size, crf=crf, pixels=colour, preset=H264_PRESET, refresh_hz=refresh_hz), images
    )


def _stream(name: str, stream: Stream, images: Sequence[Bytes]) -> dict[str, float]:
    """Bytes and CPU seconds a pixel of all images but the first, which alone is a key frame."""
    stream.encode(images[0])
    messages = list[bytes]()
    spent = _timed(lambda: messages.extend(stream.encode(image) for image in images[1:]))
    pixels = images[0].shape[0] * images[0].shape[1] * max(len(messages), 1)
    return {f"{name}_pixel_bytes": sum(map(len, messages)) / pixels, f"{name}_pixel_s": spent / pixels}


def _turn_s(told: Sequence[Told], found: dict[str, float], events_per_s: float) -> float:
    """CPU seconds of a turn of a renderer's loop, sleep and waking included, without messages and packets."""
    known = sum(len(one.steps) * found["packet_s"] + one.seconds * events_per_s * found["event_s"] for one in told)
    return max(0.0, sum(one.beside_s for one in told) - known) / max(sum(one.turns for one in told), 1)


def _sockets(plan: Plan, packet_bytes: int) -> dict[str, float]:
    """CPU seconds of messages between two ends that are one process here, with its threads."""
    rank = plan.layout.renderers()[0]
    hub, event = ZmqHub("127.0.0.1", credit_bytes=2 * MESSAGES * packet_bytes), Director(plan, 0.0).event
    link, renderer = ZmqLink(hub.endpoint, rank=1), Renderer(plan, hello_of(rank), ready=lambda _: True)
    loop = Loop(renderer, Wire(), ManualClock())
    beat, told = Heartbeat(rank=1, time=1.0, samples_of={"main": 1}, time_of={"main": 1}), serialise(event)
    try:
        while not link.credit.window:
            hub.drain(1)
            link.wait(0.01)
            link.ready()
        peer = hub_peer(hub)
        way = _way(lambda: link.send(serialise(beat)), lambda: [parse_control(data) for _, data in hub.messages()])
        events = _way(lambda: hub.send(peer, told), lambda: [_tell(loop, data) for data in link.receive()])
        packets = _way(lambda: link.offer(bytes(packet_bytes)), lambda: hub.drain(1 << 30))
    finally:
        link.close()
        hub.close()
    return {
        "message_s": sum(way) / 2, "event_send_s": events[0], "event_s": events[1], "packet_s": sum(packets) / 2,
    }  # fmt: skip


def _tell(loop: Loop, data: bytes) -> Message:
    message = parse_control(data)
    loop.tell(message)
    return message


def hub_peer(hub: ZmqHub) -> bytes:
    """The only link of a hub."""
    return next(iter(hub._credits))


def _way(send: Callable[[], object], receive: Callable[[], Sequence[object]]) -> tuple[float, float]:
    """CPU seconds of sending one message and of receiving it. Raises RunError where they do not come."""
    began = time.process_time()
    for _ in range(MESSAGES):
        send()
    sent, came, limit = time.process_time(), 0, time.perf_counter() + PATIENCE_S
    while came < MESSAGES:
        came += len(receive())
        if time.perf_counter() > limit:
            raise RunError(f"{came} of {MESSAGES} messages came through a socket of this machine; wanted: all")
    return (sent - began) / MESSAGES, (time.process_time() - sent) / MESSAGES
