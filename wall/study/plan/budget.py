"""What a wall needs: what the eye resolves, samples and bytes a second, ranks, compositors, links, time at each hop.

Arithmetic alone, from the wall and from measured rates; how many ranks behave together is simulated, see simulation.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from wall.roles.adaptive_renderer import SHARE_OF_TIME
from wall.roles.manager import EVENTS_A_REFRESH
from wall.run.head import INPUT_POLL_S
from wall.study.plan.rates import Rates
from wall.study.plan.target import INCH_M, Target

ACUITY_CYCLES = 60.0  # a degree: "details spanning one cycle per minute of visual angle", Watson and Luebke 2005
HYPERACUITY_ARCSEC = 4.0  # "just a few seconds of visual angle", same place; its 3,000 dpi are 3.8 at 18 inches
FEWER_SAMPLES = 10.0  # than framed at the same error: "an order of magnitude", same place, of its prototype
BYTES_A_PIXEL = 3  # 24 bits, as the article counts
FLICKER_HZ = 60.0  # "typically loses sensitivity to flicker above about 60 Hz", same place
DELAY_LIMIT_S = 0.015  # "even 15 ms of delay slows and causes errors in interaction", same place


@dataclass(frozen=True, slots=True, kw_only=True)
class Machines:
    """What a wall is to run on."""

    cores_a_rank: float = 1.0  # that a renderer traces with
    cores_a_compositor: float = 1.0
    link_bytes_per_s: float = 1.25e9  # of one machine's network, each way: 10 Gbit/s
    link_s: float = 50e-6  # latency of a message between machines
    display_delay_s: float = 0.0  # from a refresh to its light


@dataclass(frozen=True, slots=True, kw_only=True)
class Acuity:
    """What the eye resolves of a wall, from where it stands."""

    pixels_per_degree: float
    cycles_per_degree: float  # the finest grating that the pixels show: two of them a cycle
    minutes_a_pixel: float
    acuity_dpi: float  # at which the wall shows ACUITY_CYCLES
    acuity_pixels: float  # of the same area then
    hyperacuity_dpi: float  # at which a pixel spans HYPERACUITY_ARCSEC
    hyperacuity_pixels: float
    acuity_distance_m: float  # from there on the wall shows all that the eye resolves
    hyperacuity_distance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """One way to fill the wall, of framed, JPEG, H.264 and adaptive."""

    name: str
    samples_per_s: float
    bytes_per_s: float  # to the displays
    cores: float  # that trace
    coding_cores: float  # that encode, or pack samples beside tracing them: 0
    ranks: int
    links: int  # of a machine each that carry the bytes
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hop:
    """A step from an input to the light: how long it takes in the mean, and why."""

    name: str
    seconds: float
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """All of it."""

    target: Target
    fewer: float  # samples of adaptive sampling than framed, at the same error
    acuity: Acuity
    ways: tuple[Way, ...]
    compositor_cores: float  # that take samples in and refresh, adaptive
    compositors: int
    streams_a_compositor: float  # renderers that send to one
    hops: tuple[Hop, ...]

    @property
    def latency_s(self) -> float:
        """From an input to its light, in the mean."""
        return sum(hop.seconds for hop in self.hops)


def acuity_of(target: Target) -> Acuity:
    """A pixel of pitch p at distance d, seen straight on, spans 2 atan(p / 2d)."""
    pitch, distance = INCH_M / target.dpi, target.distance_m
    degrees = math.degrees(2.0 * math.atan(pitch / (2.0 * distance)))

    def spanning(angle: float) -> float:
        return 2.0 * distance * math.tan(math.radians(angle) / 2.0)

    def seen_from(angle: float) -> float:
        return pitch / (2.0 * math.tan(math.radians(angle) / 2.0))

    acute, hyper = 1.0 / (2.0 * ACUITY_CYCLES), HYPERACUITY_ARCSEC / 3600.0
    return Acuity(
        pixels_per_degree=1.0 / degrees,
        cycles_per_degree=0.5 / degrees,
        minutes_a_pixel=60.0 * degrees,
        acuity_dpi=INCH_M / spanning(acute),
        acuity_pixels=target.area_m2 / spanning(acute) ** 2,
        hyperacuity_dpi=INCH_M / spanning(hyper),
        hyperacuity_pixels=target.area_m2 / spanning(hyper) ** 2,
        acuity_distance_m=seen_from(acute),
        hyperacuity_distance_m=seen_from(hyper),
    )


def ways_of(target: Target, rates: Rates, machines: Machines, fewer: float = FEWER_SAMPLES) -> tuple[Way, ...]:
    """Framed as it is, as JPEG and as H.264; frameless; and adaptive, whose samples travel as packets.

    Framed and frameless trace one sample a pixel and refresh; adaptive `fewer` times fewer. A core traces the same
    samples either way; the adaptive one also spends SHARE_OF_TIME on its own deep buffer at most.
    """
    pixels = target.pixels * target.refresh_hz
    per_core = rates.samples_per_s

    def way(name: str, samples: float, size: float, coding: float, share: float, note: str) -> Way:
        cores = samples / (per_core * share)
        return Way(
            name=name, samples_per_s=samples, bytes_per_s=size, cores=cores, coding_cores=coding,
            ranks=math.ceil((cores + coding) / machines.cores_a_rank),
            links=math.ceil(size / machines.link_bytes_per_s), note=note,
        )  # fmt: skip

    found = [
        way("framed, raw", pixels, BYTES_A_PIXEL * pixels, 0.0, 1.0, f"{BYTES_A_PIXEL} a pixel"),
        way(
            "framed, JPEG", pixels, rates.jpeg_pixel_bytes * pixels, rates.jpeg_pixel_s * pixels, 1.0,
            f"{rates.jpeg_pixel_bytes:.3f} a pixel",
        ),
    ]  # fmt: skip
    if rates.h264_pixel_bytes is not None and rates.h264_pixel_s is not None:
        size, spent = rates.h264_pixel_bytes * pixels, rates.h264_pixel_s * pixels
        found.append(way("framed, H.264", pixels, size, spent, 1.0, f"{rates.h264_pixel_bytes:.3f} a pixel"))
    sample = f"{rates.sample_bytes:.2f} a sample"
    found.append(way("frameless, samples", pixels, rates.sample_bytes * pixels, 0.0, 1.0, sample))
    fewest = pixels / fewer
    found.append(way("adaptive, samples", fewest, rates.sample_bytes * fewest, 0.0, 1.0 - SHARE_OF_TIME, sample))
    return tuple(found)


def hops_of(target: Target, rates: Rates, machines: Machines, compositors: int) -> tuple[Hop, ...]:
    """Mean time at every hop of an adaptive wall whose machines keep up; the simulation adds what waits for what."""
    period, batch = 1.0 / target.refresh_hz, rates.batch_s / max(machines.cores_a_rank, 1e-9)
    packet = rates.packet_bytes
    layer = target.pixels / max(target.panels, compositors)
    refresh = layer * rates.refresh_pixel_s
    return (
        Hop(name="input is read", seconds=INPUT_POLL_S / 2, why=f"polled every {1e3 * INPUT_POLL_S:g} ms"),
        Hop(name="event is due", seconds=period / EVENTS_A_REFRESH / 2, why=f"{EVENTS_A_REFRESH} events a refresh"),
        Hop(name="event travels", seconds=machines.link_s + 2 * rates.message_s, why="one control message"),
        Hop(name="batch under way", seconds=batch / 2, why=f"{rates.batch_samples:.0f} samples, half of them left"),
        Hop(name="batch is traced", seconds=batch, why=f"{rates.samples_per_s / 1e6:.2f} M samples/s a core"),
        Hop(
            name="packet travels", seconds=machines.link_s + packet / machines.link_bytes_per_s,
            why=f"{packet} bytes at {8e-9 * machines.link_bytes_per_s:g} Gbit/s",
        ),
        Hop(name="samples go in", seconds=rates.insert_s, why="decoded, inserted"),
        Hop(name="refresh is due", seconds=period / 2, why=f"{target.refresh_hz:g} Hz"),
        Hop(
            name="image is made", seconds=refresh / machines.cores_a_compositor,
            why=f"{layer / 1e6:.2g} Mpixel a compositor",
        ),
        Hop(name="display", seconds=machines.display_delay_s, why="as given"),
    )  # fmt: skip


def budget_of(target: Target, rates: Rates, machines: Machines, fewer: float = FEWER_SAMPLES) -> Budget:
    """The budget of a wall."""
    ways = ways_of(target, rates, machines, fewer)
    adaptive = ways[-1]
    cores = target.pixels * target.refresh_hz * rates.refresh_pixel_s
    cores += adaptive.samples_per_s * rates.insert_s / rates.batch_samples
    links = adaptive.links
    compositors = max(math.ceil(cores / machines.cores_a_compositor), links, 1)
    return Budget(
        target=target, fewer=fewer, acuity=acuity_of(target), ways=ways, compositor_cores=cores,
        compositors=compositors, streams_a_compositor=adaptive.ranks / compositors,
        hops=hops_of(target, rates, machines, compositors),
    )  # fmt: skip
