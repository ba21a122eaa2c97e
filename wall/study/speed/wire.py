"""What packets cost: encoding, decoding, bytes of the adaptive sampler's, and the whole way to a deep buffer."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection

from wall.core.clock import ManualClock
from wall.core.data import Batch, Event
from wall.packets.samples import HEADER_BYTES, Codec, decode, encode
from wall.roles.layer import PanelCompositor
from wall.roles.plan import Plan, first_event
from wall.roles.worker import Worker, make_samplers
from wall.run.clock import HeadClock
from wall.study.speed.record import Row, bounded, compared, median
from wall.study.speed.tracing import plan_of
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene
from wall.transport.curve import Keys
from wall.transport.zeromq import ZmqHub, ZmqLink

CREDIT_BYTES = 1 << 20
SETTLE_S, SPAN_S = 0.3, 1.5
BATCHES = 64
RATE = 400e3  # samples a second of the adaptive sampler's clock, which is turned by hand
STEP = 0.02  # world units that the eye slides at every adaptive batch
SETTLED, ADAPTIVE_BATCHES = 40, 24  # batches before, and measured
LARGEST_ADAPTIVE_BYTES = 6.5
TIMES_TRACING = 4.0  # encoding may take a quarter of what tracing does


class Source:
    """A renderer's worker on one panel of the courtyard that never runs out of work."""

    def __init__(self, plan: Plan, tracer_scene: TracerScene) -> None:
        rank = plan.layout.renderers()[0]
        clock = HeadClock()
        samplers = make_samplers(plan, "", plan.layout.region(rank), clock)
        self.worker = Worker(plan, tracer_scene, rank, clock, samplers, 0)
        self._event = first_event(plan, 0.0)

    def packet(self) -> bytes:
        """Returns the worker's next packet; starts the sampler again when it is done."""
        while (packet := self.worker.step(self._event)) is None:
            self.worker.sampler.restart()
        return packet

    def traced_rates(self, seconds: float) -> tuple[float, float]:
        """Samples a second of tracing the sampler's batches, and of choosing and tracing them."""
        sampler, tracer = self.worker.sampler, self.worker._tracer_at(self._event, self.worker.sampler.coherent)
        done, tracing, began = 0, 0.0, time.perf_counter()
        while time.perf_counter() - began < seconds:
            targets = sampler.choose(self._event)
            if targets is None:
                sampler.restart()
                continue
            started = time.perf_counter()
            tracer.trace(targets.xy)
            tracing += time.perf_counter() - started
            done += len(targets.xy)
        return done / tracing, done / (time.perf_counter() - began)


def codecs(rounds: int) -> list[Row]:
    """encode and decode, M samples/s of one core at the default batch size."""
    plan = plan_of("courtyard")
    source = Source(plan, make_tracer_scene(plan.scene))
    batches = [decode(source.packet()) for _ in range(BATCHES)]
    packets = {codec: [encode(batch, codec) for batch in batches] for codec in Codec}
    samples = sum(len(batch.samples) for batch in batches)
    rates: dict[str, dict[Codec, list[float]]] = {name: {codec: [] for codec in Codec} for name in ("encode", "decode")}
    for _ in range(rounds):
        for codec in Codec:
            rates["encode"][codec].append(samples / _seconds(partial(_encode_all, batches, codec)) / 1e6)
            rates["decode"][codec].append(samples / _seconds(partial(_decode_all, packets[codec])) / 1e6)
    sizes = {codec.name.lower(): round(sum(map(len, packets[codec])) / samples, 2) for codec in Codec}
    note = f"courtyard, frameless, {len(batches[0].samples)} samples a packet, codec none"
    return [
        compared(
            metric, found[Codec.NONE], [10.0] * rounds, unit="M samples/s", at_least=1.0, note=note,
            **{codec.name.lower(): round(median(found[codec]), 1) for codec in Codec}, bytes_a_sample=sizes,
        )
        for metric, found in rates.items()
    ]  # fmt: skip


def _encode_all(batches: list[Batch], codec: Codec) -> None:
    for batch in batches:
        encode(batch, codec)


def _decode_all(packets: list[bytes]) -> None:
    for packet in packets:
        decode(packet)


def _seconds(work: Callable[[], object], timer: Callable[[], float] = time.perf_counter) -> float:
    began = timer()
    work()
    return timer() - began


def adaptive_codec(rounds: int) -> list[Row]:
    """Bytes a sample, and encoding against tracing in CPU time, while the view moves.

    Batches of the courtyard, as they come back from the wire, are traced and encoded again, in turn.
    """
    plan = plan_of("courtyard")
    tracer_scene = make_tracer_scene(plan.scene)
    rank = plan.layout.renderers()[0]
    region, clock = plan.layout.region(rank), ManualClock()
    worker = Worker(plan, tracer_scene, rank, clock, make_samplers(plan, "adaptive", region, clock), 0)
    packets = _moving(plan, worker, clock)
    batches = [decode(packet) for packet in packets]
    samples = sum(len(batch.samples) for batch in batches)
    tracer = Tracer(tracer_scene, plan.layout.panel(region), plan.view.eye, coherent=worker.sampler.coherent)
    encoded, decoded, traced = [], [], []
    for _ in range(rounds):
        encoded.append(samples / _seconds(partial(_encode_all, batches, Codec.NONE), time.thread_time) / 1e6)
        decoded.append(samples / _seconds(partial(_decode_all, packets), time.thread_time) / 1e6)
        traced.append(samples / _tracing(tracer, plan, batches) / 1e6)
    size = sum(map(len, packets)) / samples
    plain = [replace(batch, adaptive=False) for batch in batches]
    others = {
        f"plain_{codec.name.lower()}": round(sum(len(encode(batch, codec)) for batch in plain) / samples, 2)
        for codec in Codec
    }
    note = f"courtyard, eye slides, {samples / len(batches):.0f} samples a packet, {HEADER_BYTES} bytes of header"
    return [
        bounded("adaptive_bytes", size, LARGEST_ADAPTIVE_BYTES, unit="bytes a sample", below=True, note=note, **others),
        compared(
            "adaptive_encode", encoded, traced, unit="M samples/s", at_least=TIMES_TRACING, note="limit: tracing them",
            decode=round(median(decoded), 1),
        ),
    ]  # fmt: skip


def _moving(plan: Plan, worker: Worker, clock: ManualClock) -> list[bytes]:
    """Packets of an eye that slides, once the image has settled."""
    event, packets = first_event(plan, 0.0), []
    for _ in range(SETTLED + ADAPTIVE_BATCHES):
        event = _slid(event)
        packet = worker.step(event)
        if packet is not None:
            clock.advance(len(decode(packet).samples) / RATE)
            packets.append(packet)
    return packets[-ADAPTIVE_BATCHES:]


def _slid(event: Event) -> Event:
    x, y, z = event.camera.position
    camera = replace(event.camera, position=(x + STEP, y, z))
    return replace(event, camera_event=event.camera_event + 1, camera=camera)


def _tracing(tracer: Tracer, plan: Plan, batches: list[Batch]) -> float:
    """Seconds that tracing the batches' positions takes, taking their events not counted."""
    total = 0.0
    for batch in batches:
        tracer.set_event(replace(first_event(plan, 0.0), camera=batch.camera, scene_time=batch.scene_time))
        xy = batch.samples["xy"].copy()
        total += _seconds(partial(tracer.trace, xy), time.thread_time)
    return total


def end_to_end(rounds: int) -> list[Row]:
    """Samples a second from a tracing process, over TCP, into the deep buffer, against tracing or decoding alone."""
    plan = plan_of("courtyard")
    tracer_scene = make_tracer_scene(plan.scene)
    source = Source(plan, tracer_scene)
    packets = [source.packet() for _ in range(BATCHES)]
    samples = sum(len(decode(packet).samples) for packet in packets)
    values, limits, chosen = [], [], []
    for _ in range(rounds):
        tracing, choosing = source.traced_rates(SPAN_S / 2)
        decoding = samples / _seconds(partial(_decode_all, packets))
        limits.append(min(tracing, decoding) / 1e6)
        chosen.append(choosing / 1e6)
        values.append(_received_rate(plan, tracer_scene) / 1e6)
    note = (
        "courtyard, frameless, one renderer process to one receiver over loopback TCP, codec none; "
        "the limit has no choosing, encoding, sending or inserting"
    )
    more = {"choosing_and_tracing": median(chosen)}
    return [compared("end_to_end", values, limits, unit="M samples/s", at_least=0.85, note=note, **more)]


def encrypted(rounds: int) -> list[Row]:
    """Samples a second that get from a process to another over TCP, encrypted, against the same in the open."""
    plan = plan_of("courtyard")
    packet = Source(plan, make_tracer_scene(plan.scene)).packet()
    samples = len(decode(packet).samples)
    keys = Keys.of_all(2)
    closed, opened = [], []
    for _ in range(rounds):
        opened.append(_carried_rate(packet, None, None) * samples / 1e6)
        closed.append(_carried_rate(packet, *keys) * samples / 1e6)
    note = (
        f"packets of {samples} samples and {len(packet)} bytes over loopback TCP, codec none; nothing is traced, "
        "encoded or decoded; encrypted: CURVE"
    )
    size = len(packet) / samples / 1e3
    more = {"gb_per_s": round(median(closed) * size, 2), "open_gb_per_s": round(median(opened) * size, 2)}
    return [compared("encrypted", closed, opened, unit="M samples/s", at_least=0.25, note=note, **more)]


def _carried_rate(packet: bytes, ours: Keys | None, theirs: Keys | None) -> float:
    """Packets a second from a process that does nothing but send."""
    context = multiprocessing.get_context("fork")
    near, far = context.Pipe()
    child = context.Process(target=_offer, args=(packet, theirs, far), daemon=True)
    child.start()
    hub = ZmqHub("127.0.0.1", credit_bytes=CREDIT_BYTES, keys=ours)
    try:
        near.send(hub.endpoint)
        _taken(hub, SETTLE_S)
        return _taken(hub, SPAN_S)
    finally:
        child.kill()
        child.join(5.0)
        hub.close()


def _taken(hub: ZmqHub, seconds: float) -> float:
    """Take packets in for some seconds; packets a second."""
    done, began = 0, time.perf_counter()
    while time.perf_counter() - began < seconds:
        for peer, packet in hub.drain(1 << 20):
            done += 1
            hub.release(peer, len(packet))
        hub.wait(0.01)
    return done / (time.perf_counter() - began)


def _received_rate(plan: Plan, tracer_scene: TracerScene) -> float:
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    child = context.Process(target=_send, args=(plan, tracer_scene, theirs), daemon=True)
    child.start()
    hub = ZmqHub("127.0.0.1", credit_bytes=CREDIT_BYTES)
    panel = PanelCompositor(plan, 0)
    try:
        ours.send(hub.endpoint)
        _receive(hub, panel, SETTLE_S)
        return _receive(hub, panel, SPAN_S)
    finally:
        child.kill()
        child.join(5.0)
        hub.close()


def _receive(hub: ZmqHub, panel: PanelCompositor, seconds: float) -> float:
    """Take packets in for some seconds; samples a second."""
    done, began = 0, time.perf_counter()
    while time.perf_counter() - began < seconds:
        for peer, packet in hub.drain(1 << 20):
            batch = decode(packet)
            panel.insert(batch)
            done += len(batch.samples)
            hub.release(peer, len(packet))
        hub.wait(0.01)
    return done / (time.perf_counter() - began)


def _offer(packet: bytes, keys: Keys | None, pipe: Connection) -> None:
    parent = os.getppid()
    link = ZmqLink(pipe.recv(), rank=1, keys=keys)
    while os.getppid() == parent:
        if link.ready():
            link.offer(packet)
        else:
            link.wait(0.002)


def _send(plan: Plan, tracer_scene: TracerScene, pipe: Connection) -> None:
    parent = os.getppid()
    link = ZmqLink(pipe.recv(), rank=1)
    source = Source(plan, tracer_scene)
    while os.getppid() == parent:  # killed with the measurement, or alone after it
        if link.ready():
            link.offer(source.packet())
        else:
            link.wait(0.002)
