"""What many lights cost on paths, and how much less noise trees that choose among them leave: a long hall of lamps.

The hall is 200 m long, with a block for every 5 m on its floor. Lamps are flat boxes of 12 triangles that hang in rows
below the ceiling, instances of one mesh; points and spots hang there instead. All of a kind together shine the same,
however many they are. `python -m wall.study.speed.many_lights "100 lamps" "32 points" CONFIG` compares both ways to
choose: by power (points: all of them), and by trees, for lamps from 6 and points from 32 on.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace

import numpy as np

from wall.config.loading import load
from wall.core.data import Event, Float32, Float64
from wall.geometry.cameras import look_at
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.sampling.ownership import block_order
from wall.scene.build import Scene, assemble
from wall.scene.builtin.shapes import box, placed
from wall.scene.model import Instance, Light, Material, PointLight, Sky, Source, SpotLight
from wall.study.speed.record import Row, bounded, median, reported
from wall.study.speed.tracing import plan_of
from wall.tracing.light_trees import EmitterTree, emitter_tree
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

WIDTH, HEIGHT, LENGTH = 8.0, 5.0, 200.0  # of the hall, m
HUNG = 0.3  # m below the ceiling
BLACK, GREY = (0.0, 0.0, 0.0), (0.6, 0.6, 0.6)
AREA, RADIANCE = 40.0, 10.0  # m^2 of all boxes, seen from below; W sr^-1 m^-2
INTENSITY = 600.0  # W/sr, of all points or spots
PIXELS, DEPTH = (192, 108), 4
FEW, MANY = 10, 10_000
SAMPLES = 24  # of each pixel, for noise
TRIANGLES = 12  # of a lamp
MOST_TIMES = 3.0  # what many lights may cost, of what few do
LEAST_GAIN = 2.0


def hall(count: int, kind: str = "lamps") -> Scene:
    """A scene of paths with `count` lights: "lamps", "points" or "spots"."""
    across = max(1, round((count * WIDTH / LENGTH) ** 0.5))
    along = -(-count // across)
    x = (np.arange(count) % across + 0.5) * WIDTH / across - WIDTH / 2
    z = (np.arange(count) // across + 0.5) * LENGTH / along
    places = np.column_stack([x, np.full(count, HEIGHT - HUNG), -z])
    edge = (AREA / count) ** 0.5
    matt = Material(name="matt", base_color=GREY)
    shining = Material(name="lamp", base_color=BLACK, emission=(RADIANCE,) * 3, emits_behind=False)
    room, lamp = box(WIDTH, HEIGHT, LENGTH), box(edge, 0.2 * edge, edge)
    meshes = room.shaded(0), box(1.0, 1.0, 1.0).shaded(0), lamp.shaded(1)
    instances = [Instance(name="hall", mesh=0, world_from_object=placed(0.0, 0.0, -LENGTH / 2))]
    for k in range(round(LENGTH / 5.0)):
        matrix = placed(2.5 * (-1) ** k, 0.0, -5.0 * k - 2.0, turn_degrees=20.0 * k)
        instances.append(Instance(name="block", mesh=1, world_from_object=matrix))
    if kind == "lamps":
        instances += [Instance(name="lamp", mesh=2, world_from_object=placed(*place)) for place in places.tolist()]
    lights = () if kind == "lamps" else tuple(_light(kind, place, count) for place in places)
    sky = Sky(zenith=BLACK, horizon=BLACK, ground=BLACK)
    source = Source(meshes=meshes, materials=(matt, shining), instances=tuple(instances), lights=lights, sky=sky)
    return assemble(replace(source, path_depth=DEPTH))


def _light(kind: str, place: Float64, count: int) -> Light:
    x, y, z = place.tolist()
    shine = (INTENSITY / count,) * 3
    if kind == "points":
        return PointLight(position=(x, y, z), intensity=shine)
    down = (0.0, -1.0, 0.0)
    return SpotLight(position=(x, y, z), direction=down, intensity=shine, inner_angle=15.0, outer_angle=30.0)


@dataclass(frozen=True, slots=True)
class Bench:
    """A scene ready to trace, and the middle of every pixel."""

    tracer: Tracer
    xy: Float32  # (n, 2)

    def seconds(self) -> float:
        """CPU time of one sample."""
        began = time.thread_time()
        self.tracer.trace(self.xy, 0.0, 1)
        return (time.thread_time() - began) / len(self.xy)

    def noise(self) -> float:
        """Root mean square deviation of single samples from their pixel's mean, over the mean of all."""
        values = np.array([self.tracer.trace(self.xy, 0.0, k)[0]["radiance"].mean(axis=1) for k in range(SAMPLES)])
        deviation = values.var(axis=0, ddof=1, dtype=np.float64).mean() ** 0.5
        return float(deviation / values.mean(dtype=np.float64))

    def mean(self) -> tuple[float, float]:
        """Mean radiance of everything, by other samples than noise, and its standard error."""
        numbers = range(SAMPLES, 2 * SAMPLES)
        means = [self.tracer.trace(self.xy, 0.0, k)[0]["radiance"].mean(dtype=np.float64) for k in numbers]
        return float(np.mean(means)), float(np.std(means, ddof=1) / SAMPLES**0.5)


def bench_of(scene: Scene, *, trees: bool = True) -> Bench:
    """Looks along the hall from its end; compiled."""
    plan = plan_of("courtyard", PIXELS)
    camera = look_at((0.5, 2.0, -1.0), (0.0, 1.6, -12.0), (0.0, 1.0, 0.0))
    return _bench(plan, scene, replace(first_event(plan, 0.0), camera=camera), trees=trees)


def _bench(plan: Plan, scene: Scene, event: Event, *, trees: bool) -> Bench:
    """The first panel of a plan, which may show another scene than its own."""
    tracer = Tracer(make_tracer_scene(scene, trees=trees), plan.layout.wall.panels[0], plan.view.eye, coherent=False)
    tracer.set_event(event)
    xy = (block_order(plan.layout.regions[0][0].rect, worker=0, workers=1) + 0.5).astype(np.float32)
    bench = Bench(tracer, xy[:: max(1, len(xy) // (PIXELS[0] * PIXELS[1]))])
    bench.seconds()
    return bench


def costs(rounds: int) -> list[Row]:
    """many_lamps, many_points: microseconds a sample with 10,000 lights, against three times those with ten."""
    found = []
    for kind in ("lamps", "points"):
        many, few = bench_of(hall(MANY, kind)), bench_of(hall(FEW, kind))
        turns = [(1e6 * many.seconds(), 1e6 * few.seconds()) for _ in range(rounds)]
        ours, theirs = (median(list(column)) for column in zip(*turns, strict=True))
        note = f"{MANY} {kind} in a long hall, depth {DEPTH}, one core; limit: {MOST_TIMES:g} times {FEW} of them"
        limit = MOST_TIMES * theirs
        found.append(bounded(f"many_{kind}", ours, limit, unit="us/sample", below=True, note=note, few=theirs))
    return found


def noise() -> list[Row]:
    """lamps_noise: error of as many samples by power alone over that by a tree; and the two means."""
    benches = [bench_of(hall(MANY), trees=trees) for trees in (False, True)]
    power, tree = (bench.noise() for bench in benches)
    note = (
        f"{MANY} lamps in a long hall: RMSE of single samples by power {power:.3g}, by the tree {tree:.3g} of the mean"
    )
    return [bounded("lamps_noise", power / tree, LEAST_GAIN, unit="times", below=False, note=note)]


def upkeep(rounds: int) -> list[Row]:
    """light_tree, light_tree_move: CPU time to make the tree of 10,000 lamps, and of an event in which one moves."""
    scene = hall(MANY)
    laid = make_tracer_scene(scene)
    emitters = laid.emitters
    assert emitters is not None
    made, moved = [], []
    for turn in range(rounds + 1):
        began = time.thread_time()
        fresh = emitters._replace(tree=emitter_tree(emitters, laid.surfaces, scene.rest))
        tree = EmitterTree(fresh, laid.surfaces, laid.both_sides, scene.center)
        tree.place(scene.rest, scene.center)
        made.append(time.thread_time() - began)
        other = scene.rest.copy()
        other[-1, 0, 3] += 0.1 * (turn + 1)
        began = time.thread_time()
        tree.place(other, scene.center)
        moved.append(1e3 * (time.thread_time() - began))
    note = f"{MANY} lamps of {TRIANGLES} triangles, {len(laid.meshes)} objects, one core"
    return [
        reported("light_tree", median(made[1:]), unit="s", note=note),
        reported("light_tree_move", median(moved[1:]), unit="ms", note=f"an event in which one of {note} moves"),
    ]


def compare(what: str) -> str:
    """With and without trees: "10 lamps", "32 points", "128 spots" of the hall, or a configuration; one line."""
    if what.endswith((".yaml", ".yml")):
        plan = make_plan(make_layout(load(what)))
        benches = [_bench(plan, plan.scene, first_event(plan, 0.0), trees=trees) for trees in (False, True)]
    else:
        count, kind = what.split()
        scene = hall(int(count), kind)
        benches = [bench_of(scene, trees=trees) for trees in (False, True)]
    times = [1e6 * min(bench.seconds() for _ in range(7)) for bench in benches]
    errors, means = [bench.noise() for bench in benches], [bench.mean() for bench in benches]
    gain, apart = errors[0] / errors[1], (means[1][0] - means[0][0]) / float(np.hypot(means[0][1], means[1][1]))
    return (
        f"{what}: {times[0]:.2f} -> {times[1]:.2f} us/sample, RMSE over mean {errors[0]:.3g} -> {errors[1]:.3g} "
        f"({gain:.2f} times), error at equal time {gain * (times[0] / times[1]) ** 0.5:.2f} times, "
        f"means {means[0][0]:.5g} and {means[1][0]:.5g}, {apart:.1f} standard errors apart"
    )


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        print(compare(argument), flush=True)
