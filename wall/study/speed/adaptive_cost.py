"""What adaptive sampling costs beside tracing, and what reconstruction costs at the display: in CPU time of one thread.

An eye slides past the courtyard, one world unit a second, so every refresh reprojects every sample.
"""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import replace

import numpy as np

from wall.config.sampling import AdaptiveSampling
from wall.core.data import Batch, Event, Float32, Rect, Samples
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.packets.samples import MAX_SAMPLES, encode
from wall.reconstruction.display_values import update_display
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.adaptive_renderer import SHARE_OF_TIME
from wall.roles.plan import first_event
from wall.sampling.adaptive import AdaptiveSampler
from wall.sampling.ownership import block_order
from wall.study.speed.record import SEED, Row, bounded, compared, median
from wall.study.speed.tracing import Bench, plan_of
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

REFRESH_HZ = 60.0
SLIDE = 1.0  # world units a second
LARGEST_OVERHEAD, LEAST_OF_LIMIT = 0.3, 0.6
OWN_RAYS = 16384  # that the sampler would choose, traced alone
LIVE_S = 1.0  # CPU seconds of a round
RATE = 400e3  # samples a second that a display is given
PANELS = {  # metric: pixels, and how many cores reconstruction may use
    "reconstruct_270": ((480, 270), 0.45),
    "reconstruct_540": ((960, 540), 1.2),
    "reconstruct_1080": ((1920, 1080), 4.5),
}
SETTLED, MEASURED = 8, 24  # refreshes before, and measured
CONTROL = ("choose", "insert")  # stages beside tracing; "refresh" is reconstruction, "encode" where samples travel


class Session:
    """An adaptive renderer of one panel, taken apart so that each stage's CPU time is known."""

    def __init__(self, pixels: tuple[int, int] = (480, 270)) -> None:
        self.plan = plan = plan_of("courtyard", pixels)
        panel, eye = plan.layout.wall.panels[0], plan.view.eye
        self.rect = Rect(x=0, y=0, width=pixels[0], height=pixels[1])
        self._kept = AdaptiveSampling().samples_per_pixel
        self.image = self.new_image(detects_change=True)
        batch = AdaptiveSampling().samples_per_batch
        self._sampler = AdaptiveSampler(self.rect, self.image.feedback(), batch=batch, seed=SEED)
        self._tracer_scene = make_tracer_scene(plan.scene)
        self._tracer = Tracer(self._tracer_scene, panel, eye, coherent=self._sampler.coherent)
        self._first = first_event(plan, 0.0)
        self.seconds: defaultdict[str, float] = defaultdict(float)  # of each stage
        self.samples = 0
        self._now = 0.0

    def new_image(self, *, detects_change: bool) -> Reconstruction:
        """Returns an empty reconstruction of the session's panel."""
        panel, eye = self.plan.layout.wall.panels[0], self.plan.view.eye
        return Reconstruction(panel, eye, self.plan.scene, detects_change=detects_change, samples_per_pixel=self._kept)

    def event_at(self, now: float) -> Event:
        """Where the eye has slid to."""
        x, y, z = self._first.camera.position
        camera = replace(self._first.camera, position=(x + SLIDE * now, y, z))
        return replace(self._first, camera_event=round(now * 1e6), camera=camera)

    def first_image(self) -> list[Batch]:
        """One sample a pixel at time 0."""
        xy, event = (block_order(self.rect, worker=0, workers=1) + 0.5).astype(np.float32), self.event_at(0.0)
        self._tracer.set_event(event)
        samples, _ = self._tracer.trace(xy)
        self.image.insert(samples, 0.0, event)
        return [self._batch(samples[k : k + MAX_SAMPLES], event, 0.0) for k in range(0, len(samples), MAX_SAMPLES)]

    def refresh(self, now: float) -> None:
        """Refresh the reconstruction, and score every pixel anew."""
        began = time.thread_time()
        self.image.refresh(self.event_at(now), now)
        self._charge("refresh", began)
        began = time.thread_time()
        self._sampler.replan(self.image.feedback())
        self._charge("choose", began)

    def step(self, now: float, rays: int | None = None) -> Batch:
        """One batch, or `rays` rays, from choosing to its packet."""
        self._now, event = now, self.event_at(now)
        began = time.thread_time()
        targets = self._sampler.choose(event, rays)
        began = self._charge("choose", began)
        assert targets is not None  # something always moves
        self._tracer.set_event(event)
        samples, _ = self._tracer.trace(targets.xy)
        began = self._charge("trace", began)
        self.image.insert(samples, now, event)
        began = self._charge("insert", began)
        self._sampler.observe(samples)
        began = self._charge("choose", began)
        batch = self._batch(samples, event, now)
        encode(batch)
        self._charge("encode", began)
        self.samples += len(samples)
        return batch

    def chosen(self, rays: int) -> tuple[Float32, Event]:
        """Positions that would be chosen next, batch by batch, and for what; nothing of it is charged.

        At least `rays`. Those of more rays chosen at once would lie closer, and cost less.
        """
        event, chosen = self.event_at(self._now), list[Float32]()
        while sum(map(len, chosen)) < rays:
            targets = self._sampler.choose(event)
            assert targets is not None
            chosen.append(targets.xy)
        return np.concatenate(chosen), event

    def _charge(self, stage: str, began: float) -> float:
        now = time.thread_time()
        self.seconds[stage] += now - began
        return now

    def _batch(self, samples: Samples, event: Event, now: float) -> Batch:
        return Batch(
            view=0, panel=0, rect=self.rect, rank=1, sequence=1, camera_event=event.camera_event,
            scene_event=event.scene_event, base_time=now, samples=samples, camera=event.camera,
            scene_time=event.scene_time, adaptive=True, relightable=self._tracer_scene.needs.relighting,
            noisy=self._tracer_scene.needs.paths,
        )  # fmt: skip


def live(session: Session, seconds: float) -> None:
    """So much CPU time of one worker by itself, its image refreshed when that is due, as workers do it."""
    began = time.thread_time()
    due, now = 0.0, 0.0
    while (now := time.thread_time() - began) < seconds:
        if now >= due:
            session.refresh(now)
            due = now + max(1.0 / REFRESH_HZ, (time.thread_time() - began - now) / SHARE_OF_TIME)
        session.step(now)


def rank_side(rounds: int) -> list[Row]:
    """adaptive_overhead and adaptive_rate: a worker beside its own tracing, and beside Embree's bare rays."""
    bench = Bench("courtyard")
    bench.check()
    bench.bare_rate()
    rates, bare, own = [], [], []
    stages: defaultdict[str, float] = defaultdict(float)
    samples = 0
    for _ in range(rounds):
        session = Session()
        session.first_image()
        live(session, 0.1)
        session.seconds.clear()
        session.samples = 0
        live(session, LIVE_S)
        samples += session.samples
        rates.append(session.samples / sum(session.seconds.values()) / 1e6)
        bare.append(bench.bare_rate() / 1e6)
        own.append(Bench("courtyard", session.chosen(OWN_RAYS)).bare_rate() / 1e6)
        for stage, took in session.seconds.items():
            stages[stage] += took
    overhead = sum(stages[stage] for stage in CONTROL) / stages["trace"]
    travelling = overhead + stages["encode"] / stages["trace"]
    each = {f"{stage}_ns": round(took / samples * 1e9) for stage, took in sorted(stages.items())}
    about = "courtyard, 480x270, one worker alone, eye slides"
    note = f"{about}; ns a sample: " + ", ".join(f"{name[:-3]} {ns}" for name, ns in each.items())
    return [
        bounded(
            "adaptive_overhead", overhead, LARGEST_OVERHEAD, unit="of tracing", below=True, note=note,
            where_samples_travel=round(travelling, 3), **each,
        ),
        compared(
            "adaptive_rate", rates, own, unit="M samples/s", at_least=LEAST_OF_LIMIT,
            note=f"{about}, everything; limit: Embree tracing the same primary and shadow rays",
            bare_in_raster_order=round(median(bare), 3),
        ),
    ]  # fmt: skip


def display_side(metric: str) -> list[Row]:
    """Reconstruction of one panel that is sent RATE samples a second, from insertion to 8 bits."""
    (width, height), limit = PANELS[metric]
    session = Session((width, height))
    shown, rgb = session.new_image(detects_change=False), np.zeros((height, width, 3), np.uint8)
    for batch in session.first_image():
        shown.insert(batch.samples, 0.0, batch)
    took = placing = stored = 0.0
    for refresh in range(1, SETTLED + MEASURED + 1):
        now = refresh / REFRESH_HZ
        sent = [session.step(now - part / 4 / REFRESH_HZ, int(RATE / REFRESH_HZ / 4)) for part in (3, 2, 1, 0)]
        session.refresh(now)
        began = time.process_time()
        for batch in sent:
            shown.insert(batch.samples, batch.base_time, batch)
        placed = time.process_time()
        shown.refresh(session.event_at(now), now)
        done = time.process_time()
        update_display(shown.radiance, shown.take_dirty(), TILE, rgb)
        if refresh > SETTLED:
            took, placing, stored = took + time.process_time() - began, placing + done - placed, stored + shown.count
    cores = took / MEASURED * REFRESH_HZ
    ns = placing / stored * 1e9
    note = (
        f"courtyard, {width}x{height} at {REFRESH_HZ:g} Hz, {RATE / 1e3:g}k samples/s, eye slides; "
        f"{stored / MEASURED / 1e3:.0f}k samples stored, {ns:.0f} ns for each and refresh"
    )
    return [bounded(metric, cores, limit, unit="cores", below=True, note=note, ns_a_sample=round(ns, 1))]
