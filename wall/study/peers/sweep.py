"""All renderers in turn on the same cores: `wall measure peers`."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from wall.config.loading import load
from wall.config.sampling import METHODS
from wall.core.errors import RunError
from wall.roles.plan import Plan, make_layout, make_plan
from wall.study import json_lines
from wall.study.live import cpu_limit
from wall.study.live.images import strip
from wall.study.live.reference import WallReference
from wall.study.live.rewriting import text_for
from wall.study.live.scores import score
from wall.study.live.timeline import moments
from wall.study.options import check_names
from wall.study.peers.drawing import Codes, drawn
from wall.study.peers.process import AHEAD
from wall.study.peers.renderers import PEERS
from wall.study.peers.report import plot, write_image
from wall.study.peers.rows import FILE, Row
from wall.study.peers.runs import Found, Span, blocks_rmse, clean, run_ours, run_peer
from wall.study.quality.reference import SAMPLES_A_PIXEL
from wall.study.speed import record

BLOCK = 8  # pixels on an edge, of means that are compared at rest
RENDERERS = (*METHODS, *(name + end for name in PEERS for end in ("", AHEAD)))

Watch = Callable[[str, int, int], None]  # what is being done, how much is done, of how much


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What is to be measured: the product of configurations, cores and renderers."""

    configs: tuple[Path, ...]
    out: Path
    renderers: tuple[str, ...]
    cores: tuple[float, ...]
    size: tuple[int, int]
    seconds: float = 6.0  # measured, after the warm-up
    warm_up_s: float = 2.0
    moments: int = 24
    spp: int = SAMPLES_A_PIXEL

    @property
    def span(self) -> Span:
        """When pictures are compared."""
        times = moments(self.moments, first=self.warm_up_s, seconds=self.seconds)
        return Span(first=self.warm_up_s, seconds=self.seconds, moments=tuple(times))


@dataclass(slots=True, kw_only=True)
class Outcome:
    """What came of it."""

    rows: list[Row]
    failures: list[str]
    notes: list[str]


def missing(renderers: tuple[str, ...]) -> dict[str, str]:
    """Of renderers that are not installed, the packages that bring them, by name."""
    peers = {name: PEERS[name.removesuffix(AHEAD)] for name in renderers if name not in METHODS}
    return {name: known.package for name, known in peers.items() if find_spec(known.module) is None}


def sweep(wanted: Wanted, watch: Watch) -> Outcome:
    """Measure what is not in `wanted.out` yet. A renderer that fails keeps no other from being measured.

    Raises ConfigError, RunError for what can be refused before the first run.
    """
    check_names(wanted.configs)
    for cores in wanted.cores:
        cpu_limit.check(cores)
    absent, outcome = missing(wanted.renderers), Outcome(rows=[], failures=[], notes=[])
    if absent:
        packages = ", ".join(dict.fromkeys(absent.values()))
        outcome.notes.append(f"left out, not installed: {packages}; pip install -e '.[peers]' in the clone")
    for config in wanted.configs:
        folder = wanted.out / f"{config.stem}-{wanted.size[0]}x{wanted.size[1]}"
        folder.mkdir(parents=True, exist_ok=True)
        watch(f"{config.stem}: triangles", 0, 1)
        scene = _Scene(wanted, config, folder)
        scene.make_reference(watch)
        for cores in wanted.cores:
            present = [name for name in wanted.renderers if name not in absent]
            _compare(scene, present, cores, watch, outcome)
    if outcome.rows:
        plot(wanted.out, outcome.rows)
    return outcome


class _Scene:
    """A configuration whose scene all draw."""

    def __init__(self, wanted: Wanted, config: Path, folder: Path) -> None:
        self.wanted, self.folder = wanted, folder
        self.loaded, self.triangles = drawn(load(config), wanted.size, folder)
        self.plan: Plan = make_plan(make_layout(self.loaded))
        self.reference = WallReference(self.plan, list(wanted.span.moments), wanted.out, spp=wanted.spp)

    def make_reference(self, watch: Watch) -> None:
        """Trace the images that are not there yet."""
        self.reference.make(lambda k, n: watch(f"{self.loaded.path.stem}: reference images", k, n))

    def setup(self, name: str) -> str:
        """A hash of what is run."""
        method = name if name in METHODS else METHODS[0]
        what = f"{self.wanted.seconds} {self.wanted.warm_up_s} {text_for(self.loaded, method)}"
        return hashlib.blake2b(what.encode(), digest_size=12).hexdigest()


def _compare(scene: _Scene, renderers: list[str], cores: float, watch: Watch, outcome: Outcome) -> None:
    """Every renderer on so many cores, and their strip."""
    path, config = scene.wanted.out / FILE, scene.loaded.path.stem
    have = {row.identity: row for row in json_lines.newest(json_lines.read(path, Row))}
    middle = len(scene.reference.times) // 2
    rows: list[Row] = []
    for done, name in enumerate(renderers):
        row = have.get((config, name, cores, scene.setup(name), scene.reference.key))
        if row is None:
            watch(f"{config}, {cores:g} cores: {name}", done, len(renderers))
            try:
                row = _measure(scene, name, cores)
            except RunError as error:
                outcome.failures.append(f"{config}, {cores:g} cores, {name}: {error}")
                continue
            json_lines.append(path, row)
        rows.append(row)
    outcome.rows.extend(rows)
    shown = {row.renderer: (_kept(scene, row), row.error_over_time[middle]) for row in rows}
    if shown:
        panel = scene.plan.layout.wall.panels[0].id
        image = strip(scene.reference.codes(panel, middle), shown)
        write_image(scene.folder / f"strip-{cores:g}cores.png", image)


def _measure(scene: _Scene, name: str, cores: float) -> Row:
    """Run a renderer, and hold what it showed against the reference images."""
    folder, span = scene.folder / f"{name}-{cores:g}cores", scene.wanted.span
    folder.mkdir(parents=True, exist_ok=True)
    try:
        if name in METHODS:
            found = run_ours(scene.loaded, name, folder, span=span, cores=cores)
        else:
            found = run_peer(name, scene.plan, scene.triangles, folder, span=span, cores=cores)
        panel = scene.plan.layout.wall.panels[0]
        write_image(folder / "shown.png", found.shows.codes(panel, span.middle))
        write_image(folder / "rest.png", found.still)
        return _row(scene, name, cores, found)
    finally:
        clean(folder)


def _row(scene: _Scene, name: str, cores: float, found: Found) -> Row:
    wanted, reference = scene.wanted, scene.reference
    error, panel = score(found.shows, reference), reference.wall.panels[0]
    ideal = reference.codes(panel.id, len(reference.times) // 2)
    return Row(
        config=scene.loaded.path.stem, renderer=name, cores=cores, rmse_display=error.rmse_display, flip=error.flip,
        ssim=error.ssim, rest_rmse=blocks_rmse(found.still, ideal, 1),
        rest_blocks=blocks_rmse(found.still, ideal, BLOCK), refresh_hz=found.refresh_hz,
        interval_p95_ms=found.interval_p95_ms, cpu_cores=found.cpu_cores,
        triangles=len(scene.triangles.corners), pixels=panel.pixels[0] * panel.pixels[1], version=found.version,
        device=found.device, seconds=wanted.seconds, warm_up_s=wanted.warm_up_s, error_over_time=error.over_time,
        times=reference.times, setup=scene.setup(name), reference=reference.key, spp=reference.spp,
        other_cores=round(found.other_cores, 3), commit=record.commit(), machine=record.machine(),
        command=record.command(),
    )  # fmt: skip


def _kept(scene: _Scene, row: Row) -> Codes:
    """What a renderer showed at the middle moment: black where the picture has been deleted since."""
    from PIL import Image

    path = scene.folder / f"{row.renderer}-{row.cores:g}cores" / "shown.png"
    if not path.exists():
        width, height = scene.wanted.size
        return np.zeros((height, width, 3), np.uint8)
    return np.asarray(Image.open(path).convert("RGB"))
