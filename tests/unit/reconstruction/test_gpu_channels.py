"""Linear light, depth, object ids, alpha and times are those of the CPU on a GPU. Tested on llvmpipe as well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import moderngl
import numpy as np
import pytest
from adaptive_images import GREEN, PLATE, RED, START, centres, event_at, glowing, hits
from gpu_twins import DECIDED_BY_ROUNDING, ROUNDING, Noise, Twins
from numpy.testing import assert_allclose, assert_array_equal
from small_scenes import Triple, View, instance, keyframes, material, quad, view

from wall.core.data import Channels, Edits, Event, Float32, Framelet, Samples
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.reconstruction.channels import Coverage, blank_framelet, show_reprojected
from wall.reconstruction.choice import make_reconstruction
from wall.reconstruction.gpu.device import Device
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.scene.build import Scene, assemble
from wall.scene.model import Cut, Instance, PointLight, Source
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(97, 65))
EVERYTHING: Channels = frozenset({"colour", "depth", "alpha", "time", "object_id"})
DEPTH_ROUNDING = 1e-5  # share of it: a dot product of float32 numbers, few of which cancel. Seen: 2.4e-7
PASS = "a pass"
CALLS = (
    (moderngl.ComputeShader, "run", PASS), (moderngl.Context, "finish", "a wait"),
    *((moderngl.Context, name, name) for name in ("buffer", "clear", "copy_buffer", "copy_framebuffer")),
    *((moderngl.Buffer, name, name) for name in ("write", "read", "read_into", "clear", "orphan")),
    *((moderngl.Texture, name, name) for name in ("write", "read", "read_into")),
)  # fmt: skip


def plates(*places: Triple, cuts: tuple[Cut, ...] = ()) -> Scene:
    """A plate that stands, and one that moves before it; the background all around."""
    instances = (
        replace(instance(0), name="behind"),
        Instance(name="plate", mesh=1, world_from_object=instance(1, at=places[0]).world_from_object),
    )
    source = Source(
        meshes=(quad(2.0, 2.0, material=0), quad(1.0, 1.0, material=1)), materials=(glowing(GREEN), glowing(RED)),
        instances=instances, lights=(),
        animation=(keyframes(*places, object="plate"),) if len(places) > 1 else (),
    )  # fmt: skip
    return replace(assemble(source), cuts=cuts)


class Layers:
    """One transparent layer on the CPU and one on a GPU, that are given the same samples."""

    def __init__(
        self, scene: Scene, seen: View = SEEN, *, kept: float = 4.0, channels: Channels = EVERYTHING,
        encoded: bool = False,
    ) -> None:  # fmt: skip
        self.scene, self.seen = scene, seen
        self.transparent = "alpha" in channels
        self.made = [
            make_reconstruction(
                wish, seen.panel, seen.eye, scene, samples_per_pixel=kept, transparent=self.transparent
            )
            for wish in ("cpu", "gpu")
        ]  # fmt: skip
        self.coverages = [None if made.coverage is None else Coverage(made.coverage) for made in self.made]
        assert [type(made.image) for made in self.made] == [
            type(made.coverage) if self.transparent else type(made.image) for made in self.made
        ]
        assert isinstance(self.made[1].image, GpuReconstruction)
        self.framelets = [blank_framelet(seen.panel, channels, encoded=encoded, order=0) for _ in self.made]
        self._tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)

    def trace(self, random: np.random.Generator, count: int, event: Event) -> Samples:
        """Samples at random places and of random times within a refresh; some contradict the image."""
        xy = (random.random((count, 2)) * self.seen.panel.pixels).astype(np.float32)
        self._tracer.set_event(event)
        samples = self._tracer.trace(xy)[0].copy()
        samples["time"] = random.random(count) / 60
        samples["change"] = np.where(random.random(count) < 0.05, 0.5, 0.0)
        return samples

    def insert(self, samples: Samples, base_time: float, event: Event) -> None:
        for made, coverage in zip(self.made, self.coverages, strict=True):
            colours = samples.copy()
            if coverage is not None:
                colours, covered = coverage.split(samples)
                coverage.insert(covered, base_time, event)
            made.image.insert(colours, base_time, event)

    def refresh(self, event: Event, now: float, *, tone: Tone = AS_IT_IS) -> None:
        changed = []
        for made, coverage, framelet in zip(self.made, self.coverages, self.framelets, strict=True):
            made.image.refresh(event, now)
            dirty = made.image.take_dirty()
            if coverage is not None:
                dirty |= coverage.refresh(event, now)
            if dirty.any():
                framelet.stamp(now)
                show_reprojected(made.image, coverage, dirty, framelet, tone=tone)
            changed.append(dirty)
        assert_array_equal(*changed)

    def agree(self, *, decided: float = DECIDED_BY_ROUNDING) -> None:
        """Assert the same channels but for roundings, and for a share of pixels for what these decide."""
        cpu, gpu = self.framelets
        for name in cpu.channels:
            wrong = _apart(name, *(framelet.channel(name) for framelet in (cpu, gpu)))
            assert wrong.mean() <= decided, f"{name}: {wrong.sum()} pixels of {wrong.size}"

    @property
    def shown(self) -> Framelet:
        return self.framelets[1]


def _apart(name: str, cpu: Float32, gpu: Float32) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    if name in ("colour", "alpha"):
        most = 1 if cpu.dtype == np.uint8 else ROUNDING
        return (np.abs(cpu.astype(np.float64) - gpu) > most).reshape(*cpu.shape[:2], -1).any(axis=2)
    if name == "depth":
        return ~np.isclose(gpu, cpu, rtol=DEPTH_ROUNDING, atol=0.0)
    return np.asarray(gpu != cpu)


def at_refresh(k: int) -> Event:
    """The plate and the eye move; both rest for five refreshes; then the plate moves alone, then the eye too."""
    number = k if k < 8 else max(8, k - 5)
    aside, nearer = 0.02 * min(number, 8), 0.01 * max(number - 11, 0)
    return event_at(number, SEEN, scene_time=0.1 * number, position=(aside, 0.0, 4.0 - nearer))


@pytest.mark.parametrize(("count", "kept"), [(900, 4.0), (3000, 1.0)], ids=["sparse", "more than are kept"])
def test_all_channels_are_the_same_in_motion_at_rest_and_after_it(
    opengl: Device, random_numbers: np.random.Generator, compiled_only: None, count: int, kept: float
) -> None:
    layers = Layers(plates((-0.6, 0.0, 2.0), (0.6, 0.0, 2.0)), kept=kept)
    rested, partly = 0, 0
    for k in range(20):
        event = at_refresh(k)
        layers.refresh(event, START + (k + 1) / 60, tone=Tone(0.25))
        layers.agree()
        for batch in range(2):
            layers.insert(layers.trace(random_numbers, count, event), START + k / 60 + 0.002 * batch, event)
        rested += layers.made[1].image.nothing_moves
        alpha = layers.shown.channel("alpha")
        partly += bool(((alpha > 0.05) & (alpha < 0.95)).any())
        if k:
            assert set(np.unique(layers.shown.channel("object_id"))) == {0, 1, PLATE}
    assert rested == 5
    assert partly > 10
    assert np.isfinite(layers.shown.channel("depth")).any()
    assert np.isinf(layers.shown.channel("depth")).any()
    assert np.isfinite(layers.shown.channel("time")).mean() > 0.3


@pytest.mark.parametrize(
    "left_out", [frozenset(), {"time"}, {"depth", "alpha", "object_id"}], ids=["nothing", "time", "surfaces"]
)
def test_what_came_during_a_rest_is_in_the_channels_at_once(
    opengl: Device, compiled_only: None, left_out: Channels
) -> None:
    """At rest the GPU does nothing on its own: a nearer plate that samples bring then must show in depth and id."""
    layers = Layers(plates((9.0, 0.0, 2.0)), channels=EVERYTHING - left_out)
    event, aside = event_at(0, SEEN), (68.5, 32.5)
    layers.insert(hits(centres((97, 65)), RED, depth=4.0, object_id=1), START, event)
    for k in range(3):
        layers.refresh(event, START + 0.1 * k)
    late = hits([aside], RED, depth=2.0, object_id=PLATE)
    layers.insert(late, START + 0.3, event)
    layers.refresh(event, START + 0.31)
    layers.agree(decided=0.0)
    j, i = map(int, aside)
    if "depth" not in left_out:
        assert layers.shown.channel("object_id")[i, j] == PLATE
        assert layers.shown.channel("depth")[i, j] < 3.0
    if "time" not in left_out:
        assert layers.shown.channel("time")[i, j] + layers.shown.time_origin == pytest.approx(START + 0.3, abs=1e-4)


@pytest.mark.parametrize("channels", [EVERYTHING, frozenset({"colour", "time"})], ids=["all", "time"])
def test_samples_beyond_a_cut_are_in_no_channel_even_if_they_come_late_at_rest(
    opengl: Device, random_numbers: np.random.Generator, compiled_only: None, channels: Channels
) -> None:
    cuts = (Cut(position=(9.0, 0.0, 0.0), normal=(1.0, 0.0, 0.2)),)
    layers = Layers(plates((0.0, 0.0, 2.0), cuts=cuts), channels=channels)

    def at(k: int, x: float) -> Event:
        return replace(event_at(k, SEEN), edits=Edits(k + 1, (("cuts.0.position", (x, 0.0, 0.0)),)))

    seen = []
    for k, x in enumerate((9.0, 0.2, 0.2, 0.2)):
        event = at(min(k, 1), x)
        for older in (at(0, 9.0), event):
            layers.insert(hits(centres((97, 65)), RED, depth=2.0, object_id=PLATE), START + 0.1 * k, older)
        layers.insert(layers.trace(random_numbers, 500, event), START + 0.1 * k - 0.05, event)
        layers.refresh(event, START + 0.1 * (k + 1))
        layers.agree()
        newest = layers.shown.channel("time") + layers.shown.time_origin
        seen.append(float((newest > START + 0.1 * k - 0.01).mean()))  # those of the plate
    assert layers.made[1].image.nothing_moves
    assert max(seen[1:]) < 0.8 * seen[0]


@pytest.mark.parametrize("transparent", [False, True])
def test_display_bytes_with_channels_are_the_same_up_to_a_code(
    opengl: Device, random_numbers: np.random.Generator, compiled_only: None, transparent: bool
) -> None:
    channels = EVERYTHING if transparent else EVERYTHING - {"alpha"}
    layers = Layers(plates((-0.6, 0.0, 2.0), (0.6, 0.0, 2.0)), channels=channels, encoded=True)
    for k in range(6):
        event = at_refresh(min(k, 4))
        layers.insert(layers.trace(random_numbers, 4000, event), START + k / 60, event)
        layers.refresh(event, START + (k + 1) / 60, tone=Tone(0.5, "khronos_neutral"))
        layers.agree()
    assert layers.shown.colour.dtype == np.uint8
    assert len(np.unique(layers.shown.colour)) > 3


@pytest.mark.parametrize("times", [(-3.5, -0.25), (-1.0, 2.0), (0.0, -0.0), (1e-40, 3.0), (5.0, 5.0)])
def test_times_before_and_after_the_clock_s_zero_keep_their_order(opengl: Device, times: tuple[float, float]) -> None:
    """Integers of the same order as floats; a pixel without a sample, or with a rejected one alone, has none."""
    layers = Layers(plates((9.0, 0.0, 2.0)), channels=frozenset({"colour", "time"}))
    event = event_at(0, SEEN)
    for pair in (times, times[::-1]):
        samples = hits([(10.5, 20.5), (10.5, 20.5), (40.5, 30.5), (70.5, 30.5)], RED)
        samples["time"] = (*pair, pair[0], np.nan)
        layers.insert(samples[:3], 0.0, event)
        layers.refresh(event, 0.1)
    newest = [np.full((65, 97), 7.0, np.float32) for _ in layers.made]
    for made, found in zip(layers.made, newest, strict=True):
        made.image.write_newest_times(-1.5, found)
    assert_array_equal(*newest)
    assert newest[1][20, 10] == np.float32(max(times) + 1.5)
    assert newest[1][30, 40] == np.float32(max(times) + 1.5)
    assert np.isneginf(newest[1]).sum() == 65 * 97 - 2


def test_light_that_moves_leaves_coverage_alone(opengl: Device, compiled_only: None) -> None:
    """Stored colours are lit anew; what tells where objects are is no light."""
    scene = assemble(
        Source(
            meshes=(quad(40.0, 40.0),), materials=(material(0.8, 0.6, 0.4),), instances=(instance(0),),
            lights=(PointLight(position=(-1.0, 1.0, 2.0), intensity=(2.0, 1.5, 1.0)),),
            animation=(keyframes((-1.0, 1.0, 2.0), (1.5, 0.5, 1.5), light=0),),
        )
    )  # fmt: skip
    layers = Layers(scene)
    layers.insert(layers.trace(np.random.default_rng(0), 12000, event_at(0, SEEN)), START, event_at(0, SEEN))
    colours = []
    for k in range(3):
        layers.refresh(event_at(k, SEEN, scene_time=0.5 * k), START + 0.1 * (k + 1))
        layers.agree()
        colours.append(layers.shown.colour.copy())
    assert np.abs(colours[2] - colours[0]).max() > 0.1
    assert_allclose(layers.shown.channel("alpha"), 1.0, rtol=0, atol=ROUNDING)


def test_the_channels_of_a_moving_image_are_made_on_the_gpu(
    opengl: Device, random_numbers: np.random.Generator, monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    """Only what the layer has travels, and the CPU makes nothing of it."""
    layers = Layers(plates((-0.6, 0.0, 2.0), (0.6, 0.0, 2.0)))

    def on_the_cpu(*_: object) -> None:
        raise AssertionError("made on the CPU")

    monkeypatch.setattr(layers.made[1].image, "find_nearest", on_the_cpu)
    for made in layers.made[1].image, layers.made[1].coverage:
        monkeypatch.setattr(made._passes, "read_surfaces", on_the_cpu)  # type: ignore[union-attr]
    for k in range(3):
        layers.insert(layers.trace(random_numbers, 2000, at_refresh(k)), START + k / 60, at_refresh(k))
        layers.refresh(at_refresh(k), START + (k + 1) / 60)
        layers.agree()
    layers.refresh(at_refresh(2), START + 0.1)
    layers.insert(layers.trace(random_numbers, 2000, at_refresh(2)), START + 0.1, at_refresh(2))
    with pytest.raises(AssertionError, match="made on the CPU"):  # as means of pixels are that stand
        layers.refresh(at_refresh(2), START + 0.2)


def test_background_that_objects_are_filled_into_from_afar_is_cleared(opengl: Device, compiled_only: None) -> None:
    """Samples stand four pixels apart, at corners of pixels: none fills its own, and every third hits the plate."""
    xy = np.stack(np.meshgrid(np.arange(2.0, 95.0, 4.0), np.arange(2.0, 63.0, 4.0)), axis=-1).reshape(-1, 2)
    plate = np.arange(len(xy)) % 3 == 0
    samples = hits(xy + 0.02, RED, depth=2.0, object_id=PLATE)
    samples["object_id"][~plate], samples["depth"][~plate] = 0, np.inf
    layers = Layers(plates((9.0, 0.0, 2.0)))
    layers.insert(samples, START, event_at(0, SEEN))
    layers.refresh(event_at(0, SEEN), START + 5.0)  # by then they weigh little
    layers.agree(decided=0.0)
    covered = layers.coverages[1].radiance[..., 0]  # type: ignore[union-attr]
    alpha, i, j = layers.shown.channel("alpha"), *xy.astype(int)[:, ::-1].T
    assert (covered[i, j][~plate] > 0.01).any()
    assert (alpha[i, j][~plate] == 0.0).all()
    assert (layers.shown.colour[i, j][~plate] == 0.0).all()
    assert (alpha[i + 1, j + 1][~plate] > 0.01).any(), "beside them it is filled"


def test_depths_of_a_panel_far_out_on_a_wall_are_distances_from_the_eye(opengl: Device, compiled_only: None) -> None:
    """The same pixels, seen the same, as the last of a large wall: directions are not from the wall's first pixel."""
    plane = SEEN.panel.plane
    origin = plane.origin - 60000 * plane.per_x - 9000 * plane.per_y
    panel = replace(SEEN.panel, screen=(60000, 9000), plane=replace(plane, origin=origin))
    depths = []
    for seen in (SEEN, replace(SEEN, wall=replace(SEEN.wall, panels=(panel,)))):
        layers = Layers(plates((0.0, 0.0, 2.0)), seen)
        layers.insert(layers.trace(np.random.default_rng(1), 12000, event_at(0, SEEN)), START, event_at(0, SEEN))
        layers.refresh(event_at(0, SEEN), START + 0.1)
        layers.agree()
        depths.append(layers.shown.channel("depth"))
    assert (~np.isclose(*depths, rtol=DEPTH_ROUNDING)).mean() <= DECIDED_BY_ROUNDING


def test_an_image_that_lost_its_samples_has_no_surfaces(opengl: Device) -> None:
    layers = Layers(plates((0.0, 0.0, 2.0)), channels=frozenset({"colour", "depth", "object_id"}))
    image, event = layers.made[1].image, event_at(0, SEEN)
    layers.insert(hits(centres((97, 65)), RED), START, event)
    layers.refresh(event, START)
    assert np.isfinite(image.find_nearest().depth).all()
    image.clear()
    image.refresh(event_at(1, SEEN), START + 0.1)
    nearest = image.find_nearest()
    assert np.isposinf(nearest.depth).all()
    assert (nearest.object_id == -1.0).all()


def test_only_channels_that_are_asked_for_travel(opengl: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    layers = Layers(plates((0.0, 0.0, 2.0)), channels=frozenset({"colour"}))
    image, event = layers.made[1].image, event_at(0, SEEN)

    def travels(*_: object) -> None:
        raise AssertionError("nobody asked for it")

    monkeypatch.setattr(image, "find_nearest", travels)
    monkeypatch.setattr(image, "write_newest_times", travels)
    layers.insert(hits(centres((97, 65)), RED), START, event)
    layers.refresh(event, START)
    assert_allclose(layers.shown.colour, np.broadcast_to(RED, (65, 97, 3)), rtol=0, atol=ROUNDING)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What OpenGL is asked for from now on."""
    made: list[str] = []

    def noted(call: Callable[..., Any], name: str) -> Callable[..., Any]:
        def wrapper(*args: Any, **named: Any) -> Any:
            made.append(name)
            return call(*args, **named)

        return wrapper

    for kind, method, name in CALLS:
        monkeypatch.setattr(kind, method, noted(getattr(kind, method), name))
    return made


def test_a_pass_and_what_is_none_never_follow_each_other_without_a_wait(
    opengl: Device, random_numbers: np.random.Generator, compiled_only: None, calls: list[str]
) -> None:
    """A driver did not keep the order. Layers move, rest and move on, with more samples than are kept."""
    layers = Layers(plates((-0.6, 0.0, 2.0), (0.6, 0.0, 2.0)), kept=1.0)
    for k in range(14):
        number = k if k < 5 else max(5, k - 3)
        event = event_at(number, layers.seen, scene_time=0.1 * number, position=(0.02 * number, 0.0, 4.0))
        layers.refresh(event, START + (k + 1) / 60)
        layers.insert(layers.trace(random_numbers, 3000, event), START + k / 60, event)
        layers.made[1].image.stored()
        layers.made[1].image.accumulated_counts()
    pairs = set(pairwise(calls))
    assert len(pairs) > 5
    assert not [pair for pair in pairs if "a wait" not in pair and (pair[0] == PASS) != (pair[1] == PASS)]


def test_batches_of_the_image_shown_and_of_the_next_one_travel_together(
    opengl: Device, random_numbers: np.random.Generator, compiled_only: None, calls: list[str]
) -> None:
    """Renderers send both in turn. The plate alone moves, so pixels accumulate the batches of the image's camera."""
    scene = plates((-0.6, 0.0, 2.0), (0.6, 0.0, 2.0))
    twins, source = Twins(scene, SEEN), Noise(random_numbers, 700)
    shown = [event_at(k, SEEN, scene_time=0.1 * k) for k in range(3)]
    ahead = event_at(3, SEEN, scene_time=0.3, position=(0.1, 0.0, 4.0))
    for k, event in enumerate(shown[:2]):
        twins.insert(source.of(twins, event), START + k / 60, event)
        twins.refresh(event, START + k / 60)
    calls.clear()
    for n in range(8):
        event = (shown[1], ahead)[n % 2]
        twins.insert(source.of(twins, event), START + 0.04 + n / 600, event)
    assert calls == []
    for event in (shown[2], ahead):
        twins.refresh(event, START + 0.06)
        twins.agree(decided=DECIDED_BY_ROUNDING)
