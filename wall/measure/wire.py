"""What packets cost: packing, unpacking, and the whole way from a tracing rank to a deep buffer."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection

from wall.data import Batch
from wall.measure.record import Row, bounded, compared
from wall.measure.tracing import plan_of
from wall.packets.samples import Codec, decode, encode
from wall.processes.clock import HeadClock
from wall.processes.panel import PanelCompositor
from wall.processes.plan import Plan, first_event
from wall.processes.worker import Worker, make_samplers
from wall.tracing.resident import Resident, make_resident
from wall.transport.zeromq import ZmqHub, ZmqLink

CREDIT_BYTES = 1 << 20
SETTLE_S, SPAN_S = 0.3, 1.5
BATCHES = 64


class Source:
    """A renderer's worker on one panel of the courtyard that never runs out of work."""

    def __init__(self, plan: Plan, resident: Resident) -> None:
        rank = plan.layout.renderers()[0]
        samplers = make_samplers(plan.layout.sampling, "", plan.layout.region(rank))
        self.worker = Worker(plan, resident, rank, HeadClock(), samplers, 0)
        self._event = first_event(plan, 0.0)

    def packet(self) -> bytes:
        while (packet := self.worker.step(self._event)) is None:
            self.worker.sampler.restart()
        return packet

    def traced_rate(self, seconds: float) -> float:
        """Samples a second of choosing and tracing alone."""
        sampler, tracer = self.worker.sampler, self.worker._tracer_at(self._event, self.worker.sampler.coherent)
        done, began = 0, time.perf_counter()
        while time.perf_counter() - began < seconds:
            targets = sampler.choose(self._event)
            if targets is None:
                sampler.restart()
                continue
            tracer.trace(targets.xy)
            done += len(targets.xy)
        return done / (time.perf_counter() - began)


def codecs(rounds: int) -> list[Row]:
    """encode and decode, M samples/s of one core at the default batch size."""
    source = Source(plan_of("courtyard"), make_resident(plan_of("courtyard").scene))
    batches = [decode(source.packet()) for _ in range(BATCHES)]
    samples = sum(len(batch.samples) for batch in batches)
    rates: dict[str, dict[str, float]] = {"encode": {}, "decode": {}}
    sizes = {}
    for codec in Codec:
        packets = [encode(batch, codec) for batch in batches]
        name = codec.name.lower()
        rates["encode"][name] = samples / _fastest(partial(_encode_all, batches, codec), rounds) / 1e6
        rates["decode"][name] = samples / _fastest(partial(_decode_all, packets), rounds) / 1e6
        sizes[name] = round(sum(map(len, packets)) / samples, 2)
    note = f"courtyard, frameless, {len(batches[0].samples)} samples a packet, codec none"
    return [
        bounded(
            metric, rates[metric]["none"], 10.0, unit="M samples/s", below=False, note=note,
            **{codec: round(rate, 1) for codec, rate in rates[metric].items()}, bytes_a_sample=sizes,
        )
        for metric in ("encode", "decode")
    ]  # fmt: skip


def _encode_all(batches: list[Batch], codec: Codec) -> None:
    for batch in batches:
        encode(batch, codec)


def _decode_all(packets: list[bytes]) -> None:
    for packet in packets:
        decode(packet)


def _insert_all(panel: PanelCompositor, packets: list[bytes]) -> None:
    for packet in packets:
        panel.insert(decode(packet))


def _fastest(work: Callable[[], object], rounds: int) -> float:
    """Seconds of the fastest of some rounds: what the code takes when nobody else has the core."""
    times = []
    for _ in range(max(3, rounds)):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def end_to_end(rounds: int) -> list[Row]:
    """Samples a second from a tracing process, over TCP, into the deep buffer, against the slower end alone."""
    plan = plan_of("courtyard")
    resident = make_resident(plan.scene)
    source = Source(plan, resident)
    packets = [source.packet() for _ in range(BATCHES)]
    panel = PanelCompositor(plan.layout.wall.panels[0])
    samples = sum(len(decode(packet).samples) for packet in packets)
    values, limits = [], []
    for _ in range(rounds):
        tracing = source.traced_rate(SPAN_S / 2)
        decoding = samples / _fastest(partial(_insert_all, panel, packets), 3)
        limits.append(min(tracing, decoding) / 1e6)
        values.append(_received_rate(plan, resident) / 1e6)
    note = "courtyard, frameless, one renderer process to one receiver over loopback TCP, codec none"
    return [compared("end_to_end", values, limits, unit="M samples/s", at_least=0.8, note=note)]


def _received_rate(plan: Plan, resident: Resident) -> float:
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    child = context.Process(target=_send, args=(plan, resident, theirs), daemon=True)
    child.start()
    hub = ZmqHub("127.0.0.1", credit_bytes=CREDIT_BYTES)
    panel = PanelCompositor(plan.layout.wall.panels[0])
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


def _send(plan: Plan, resident: Resident, pipe: Connection) -> None:
    link = ZmqLink(pipe.recv(), rank=1)
    source = Source(plan, resident)
    while os.getppid() != 1:
        if link.ready():
            link.offer(source.packet())
        else:
            link.wait(0.002)
