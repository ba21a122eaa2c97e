"""What the adaptive sampler's packets cost while the view moves: bytes a sample, and encoding against tracing."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from wall.core.clock import ManualClock
from wall.core.data import Batch, Event
from wall.packets.samples import HEADER_BYTES, Codec, decode, encode
from wall.roles.plan import Plan, first_event
from wall.roles.worker import Worker, make_samplers
from wall.study.speed.record import Row, bounded, compared, median
from wall.study.speed.tracing import plan_of
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

RATE = 400e3  # samples a second of the hand-turned clock
STEP = 0.02  # world units that the eye slides at every batch
SETTLED, BATCHES = 40, 24  # batches before, and measured
LARGEST_BYTES = 6.5
SHARE = 4.0  # encoding may take a quarter of what tracing does


def measure(rounds: int) -> list[Row]:
    """Batches of the courtyard, as they come back from the wire, are traced and encoded again, in turn."""
    plan = plan_of("courtyard")
    tracer_scene = make_tracer_scene(plan.scene)
    rank = plan.layout.renderers()[0]
    region, clock = plan.layout.region(rank), ManualClock()
    worker = Worker(plan, tracer_scene, rank, clock, make_samplers(plan, "adaptive", region, clock), 0)
    packets = _moving(plan, worker, clock)
    batches = [decode(packet) for packet in packets]
    samples = sum(len(batch.samples) for batch in batches)
    tracer = Tracer(tracer_scene, plan.layout.panel(rank), plan.view.eye, coherent=worker.sampler.coherent)
    encoded, decoded, traced = [], [], []
    for _ in range(rounds):
        encoded.append(samples / _seconds(lambda: [encode(batch) for batch in batches]) / 1e6)
        decoded.append(samples / _seconds(lambda: [decode(packet) for packet in packets]) / 1e6)
        traced.append(samples / _tracing(tracer, plan, batches) / 1e6)
    size = sum(map(len, packets)) / samples
    plain = [replace(batch, adaptive=False) for batch in batches]
    others = {
        f"plain_{codec.name.lower()}": round(sum(len(encode(batch, codec)) for batch in plain) / samples, 2)
        for codec in Codec
    }
    note = f"courtyard, eye slides, {samples / len(batches):.0f} samples a packet, {HEADER_BYTES} bytes of header"
    return [
        bounded("adaptive_bytes", size, LARGEST_BYTES, unit="bytes a sample", below=True, note=note, **others),
        compared(
            "adaptive_encode", encoded, traced, unit="M samples/s", at_least=SHARE, note="limit: tracing them",
            decode=round(median(decoded), 1),
        ),
    ]  # fmt: skip


def _moving(plan: Plan, worker: Worker, clock: ManualClock) -> list[bytes]:
    """Packets of an eye that slides, once the image has settled."""
    event, packets = first_event(plan, 0.0), []
    for _ in range(SETTLED + BATCHES):
        event = _slid(event)
        packet = worker.step(event)
        if packet is not None:
            clock.advance(len(decode(packet).samples) / RATE)
            packets.append(packet)
    return packets[-BATCHES:]


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
        total += _seconds(lambda xy=xy: tracer.trace(xy))  # type: ignore[misc]
    return total


def _seconds(work: Callable[[], object]) -> float:
    """Of this thread's CPU: it is compared with itself."""
    began = time.thread_time()
    work()
    return time.thread_time() - began
