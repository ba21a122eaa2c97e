"""What packets cost: packing, unpacking, and the whole way from a tracing rank to a deep buffer."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection

from wall.core.data import Batch
from wall.packets.samples import Codec, decode, encode
from wall.roles.layer import PanelCompositor
from wall.roles.plan import Plan, first_event
from wall.roles.worker import Worker, make_samplers
from wall.run.clock import HeadClock
from wall.study.speed.record import Row, compared, median
from wall.study.speed.tracing import plan_of
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene
from wall.transport.zeromq import ZmqHub, ZmqLink

CREDIT_BYTES = 1 << 20
SETTLE_S, SPAN_S = 0.3, 1.5
BATCHES = 64


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


def _seconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


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
    return [compared("end_to_end", values, limits, unit="M samples/s", at_least=0.8, note=note, **more)]


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


def _send(plan: Plan, tracer_scene: TracerScene, pipe: Connection) -> None:
    parent = os.getppid()
    link = ZmqLink(pipe.recv(), rank=1)
    source = Source(plan, tracer_scene)
    while os.getppid() == parent:  # killed with the measurement, or alone after it
        if link.ready():
            link.offer(source.packet())
        else:
            link.wait(0.002)
