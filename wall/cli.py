"""The `wall` command: reads its words, calls one function, says what came of it.

Exit codes: 0 ok, 1 the run failed, 2 the configuration was refused.
"""

from __future__ import annotations

import os
import sys
import threading
import time
import webbrowser
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from wall.core.errors import ConfigError, WallError

OK, FAILED, REFUSED = 0, 1, 2
MODEL_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
    help="A ray-traced display wall: every process renders its own part of it, nothing waits for a frame.\n\n"
    "Try [bold]wall run configs/demo.yaml[/], then open the address it prints. "
    "[bold]wall check[/] says what a configuration does before it does it.",
)
measure = typer.Typer(no_args_is_help=True, help="Measure this machine and this code.")
app.add_typer(measure, name="measure")
errors = Console(stderr=True, highlight=False, soft_wrap=True)
console = Console(highlight=False)

ConfigArgument = Annotated[
    Path, typer.Argument(help="Configuration, a YAML file such as configs/demo.yaml", show_default=False)
]


@app.command()
def run(
    config: ConfigArgument,
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Stop after so many seconds; without it, run until Ctrl-C")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for wall.png, panel-ID.png and summary.json")] = None,
    scene: Annotated[Path | None, typer.Option(help="Show this model instead: .glb, .gltf, .obj, .ply or .stl")] = None,
    headless: Annotated[bool, typer.Option("--headless", help="No browser page")] = False,
    still: Annotated[bool, typer.Option("--still", help="Begin paused, at time 0")] = False,
    until_complete: Annotated[
        bool, typer.Option("--until-complete", help="Show time 0 and stop when the picture has all its samples")
    ] = False,
) -> None:
    """Run a wall: start its processes here, or use the ranks that mpirun made.

    [bold]wall run configs/demo.yaml --seconds 20[/]

    [bold]mpirun -n 5 wall run configs/demo.yaml --headless --seconds 20[/]
    """
    from wall.run.launch import Options
    from wall.run.launch import run as run_wall

    loaded = _load(config, scene)
    options = Options(
        out=out or Path(loaded.config.output.directory),
        seconds=seconds,
        headless=headless,
        until_complete=until_complete,
        still=still or until_complete,
    )
    with _Stages() as stages:
        outcome = run_wall(
            loaded, options, stages.say, lambda address: stages.opened(address, loaded.config.output.browser.open)
        )
    if outcome is None:
        return
    _show_summary(outcome.summary, options.out)
    if outcome.failed:
        _fail(f"the run failed: {outcome.failed}")


@app.command()
def render(
    what: Annotated[
        Path, typer.Argument(metavar="CONFIG|MODEL", help="A configuration, or a model file", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="picture.png (8-bit sRGB), .exr or .npy (linear float32)")
    ],
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel")] = 64,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels; the wall's own if left out")] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Same seed, same picture")] = 1,
    at: Annotated[float, typer.Option(min=0.0, help="Time of the animation, seconds")] = 0.0,
) -> None:
    """Render one converged picture: the same bits for a seed, however many threads or ranks.

    [bold]wall render configs/demo.yaml --spp 64 -o wall.png[/]
    """
    from wall.commands.render import render as render_picture
    from wall.display.image_file import check_suffix, write_image

    check_suffix(output)
    loaded = _load(what, None)
    with Progress(
        TextColumn("rendering"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=errors
    ) as bar:
        task = bar.add_task("rendering")
        picture = render_picture(
            loaded,
            spp=spp,
            seed=seed,
            size=_size(size),
            at=at,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    if picture is not None:
        write_image(output, picture)
        console.print(f"wrote {output}: {picture.shape[1]}x{picture.shape[0]}, {spp} samples a pixel, seed {seed}")


@app.command()
def draw(
    config: ConfigArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="wall.svg, .pdf or .png")],
    samples_per_s: Annotated[
        float, typer.Option(min=1.0, help="Samples/s expected of a rank, for the bytes/s of its stream")
    ] = 1e6,
    width: Annotated[
        float, typer.Option(min=40.0, max=2000.0, help="Width to aim at, mm; type keeps its size")
    ] = 178.0,
) -> None:
    """Draw a wall to scale beside its compositing graph, with the bytes/s to expect between processes.

    [bold]wall draw configs/demo.yaml -o wall.svg[/]
    """
    from wall.commands.drawing.draw import draw as draw_wall

    page = draw_wall(_load(config, None), output, samples_per_s=samples_per_s, width=width)
    console.print(f"wrote {output}: {page.width:.0f} x {page.height:.0f} mm")


@app.command()
def screenshot(
    config: ConfigArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="wall.png or .tiff (8-bit sRGB), .exr (linear float32)")
    ],
    scale: Annotated[float, typer.Option(min=1e-3, max=1e4, help="Times more pixels each way than the wall has")] = 1.0,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels instead; flat walls only")] = None,
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel")] = 16,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Same seed, same picture")] = 1,
    at: Annotated[float, typer.Option(min=0.0, help="Time of the animation, seconds")] = 0.0,
    panels: Annotated[bool, typer.Option("--panels", help="A file for each panel, wall-ID.png, instead")] = False,
    bezels: Annotated[bool, typer.Option("--bezels", help="Dark bezels; else the scene goes on behind them")] = False,
) -> None:
    """Write the whole wall to a file, however large: it is drawn and written strip by strip.

    [bold]wall screenshot configs/demo.yaml --scale 8 -o wall.png[/]
    """
    from wall.commands.screenshot import Shot
    from wall.commands.screenshot import screenshot as take

    shot = Shot(size=_size(size), scale=scale, spp=spp, seed=seed, at=at, panels=panels, bezels=bezels)
    columns = (
        TextColumn("rendering"),
        BarColumn(),
        TextColumn("{task.completed} of {task.total} rows"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=errors) as bar:
        task = bar.add_task("rendering")
        written = take(
            _load(config, None), output, shot, lambda done, total: bar.update(task, completed=done, total=total)
        )
    for one in written:
        console.print(f"wrote {one.path}: {one.width}x{one.height}, {spp} samples a pixel, seed {seed}")


@app.command()
def identify(
    config: ConfigArgument,
    kind: Annotated[
        str, typer.Option("--pattern", help="identify: which panel; grid: geometry; seam: edges; gamma: greys")
    ] = "identify",
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for panel-ID.png and wall.png, instead of windows")
    ] = None,
) -> None:
    """Show a test pattern on every panel of this machine, or write them all to files.

    [bold]wall identify configs/demo.yaml --pattern grid[/]
    """
    from wall.commands.identify import kind_of, show_patterns, write_patterns

    pattern = kind_of(kind)
    if output is not None:
        files = write_patterns(_load(config, None), pattern, output)
        console.print(f"wrote {len(files)} files to {output}/")
        return
    show_patterns(_load(config, None), pattern, seconds=seconds, say=lambda line: console.print(line, markup=False))


@app.command()
def check(config: ConfigArgument) -> None:
    """Check a configuration, and say what would run where, with what, at what cost."""
    from wall.commands.check import check as check_config

    for item in check_config(_load(config, None)):
        console.print(item)


@app.command()
def expand(
    config: ConfigArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="File to write; the terminal if left out")
    ] = None,
) -> None:
    """Write a configuration with its grid, and panels that show both eyes, spelled out panel by panel: the same rays.

    What stands beside the wall, comments too, stays as it is; relative paths in it start at the file's own folder.
    """
    from wall.config.loading import load
    from wall.config.rewriting import with_wall
    from wall.geometry.panels import expanded_config

    loaded = load(config)
    text = with_wall(loaded, expanded_config(loaded.config.wall))
    if output is None:
        print(text, end="")
        return
    _write(output, text)
    console.print(f"wrote {output}")


@app.command()
def convert(
    file: Annotated[Path, typer.Argument(help="A wall described for another system", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="YAML file to write")],
    report: Annotated[Path | None, typer.Option(help="JSON file for what was carried and what was not")] = None,
    format_name: Annotated[
        str | None, typer.Option("--format", help="Name of the format; told by the file itself if left out")
    ] = None,
) -> None:
    """Convert a wall of ParaView, Tide, DisplayCluster, SGCT, SAGE2 or Equalizer to a configuration.

    [bold]wall convert cave.pvx -o cave.yaml --report cave.json[/]
    """
    from wall.importers import command

    chosen, conversion, yaml = command.convert_file(file, format_name)
    command.write(output, yaml)
    if report is not None:
        command.write_report(report, conversion)
    left_out = command.table(conversion)
    if left_out is not None:
        console.print(left_out)
    console.print(
        f"wrote {output} from {chosen.name}: {conversion.panels} panels, {conversion.ranks} ranks; "
        f"{len(conversion.carried)} things carried, {len(conversion.not_carried)} not",
        markup=False,
    )
    for sentence in conversion.assumed:
        console.print(f"note: {sentence}", markup=False, soft_wrap=True)


@measure.command()
def speed(
    output: Annotated[Path | None, typer.Option("-o", "--output", help="File for the rows, JSON lines")] = None,
    only: Annotated[list[str] | None, typer.Option(help="Measure just this metric; may be given again")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer rounds, shorter runs")] = False,
) -> None:
    """Measure speed, latency, bytes and memory, each against its limit in the same run. Takes about two minutes.

    [bold]wall measure speed -o speed.jsonl[/]
    """
    from wall.study.speed import speed as measured

    rows = []
    with errors.status("measuring") as status:
        for row in measured.measure(only or [], quick=quick, say=lambda names: status.update(f"measuring {names}")):
            rows.append(row)
            if output is not None:
                measured.write(output, rows)
    console.print(measured.table(rows))
    for note in measured.notes(rows):
        console.print(note)
    broken = [row.metric for row in rows if row.failed]
    if broken:
        _fail(f"could not be measured: {', '.join(broken)}")


@measure.command()
def quality(
    configs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[CONFIG]...", help="Scenes to measure on; the project's four if left out"),
    ] = None,
    scenes: Annotated[str, typer.Option(help="Of them only these, such as orbit,light")] = "",
    methods: Annotated[
        str,
        typer.Option("--methods", "--arms", help="Only these, such as framed,adaptive or 'taa_*'; all if left out"),
    ] = "",
    rates: Annotated[str, typer.Option(help="Rays a second")] = "100k,400k,800k",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the picture, pixels")] = "256x256",
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Seeds 1 to N")] = 5,
    out: Annotated[Path, typer.Option(help="Folder of results; what is in it already is not measured again")] = Path(
        "OUT/quality"
    ),
    clock: Annotated[
        str, typer.Option(help="virtual: the same rays for every method; cpu: the same CPU time")
    ] = "virtual",
    cores: Annotated[str, typer.Option(help="With --clock cpu, instead of rates: CPU seconds a second")] = "1,2",
    refresh_hz: Annotated[float, typer.Option(min=1.0, max=1000.0, help="Pictures shown a second")] = 60.0,
    seconds: Annotated[
        float | None, typer.Option(min=0.2, max=600.0, help="Of a run; 4, or the camera's path, if left out")
    ] = None,
) -> None:
    """Measure speed against error: every way to spend rays, held against the reference picture of each refresh.

    [bold]wall measure quality --rates 400k --seeds 1[/]
    """
    from wall.study.quality import command
    from wall.study.quality.report import write_report
    from wall.study.quality.sweep import Wanted, sweep
    from wall.study.quality.tables import tables, write_summary

    command.check_installed()
    wanted = Wanted(
        configs=command.configs_of(configs or [], scenes),
        methods=command.methods_of(methods, clock=clock),
        rates=command.rates_of(rates),
        size=_size(size) or (256, 256),
        seeds=tuple(range(1, seeds + 1)),
        out=out,
        clock=clock,
        cores=command.cores_of(cores),
        refresh_hz=refresh_hz,
        seconds=seconds,
    )
    columns = (TextColumn("{task.description:<24}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=errors, disable=not errors.is_terminal) as bar:
        task = bar.add_task("starting", total=None)
        rows = sweep(wanted, lambda what, done, of: bar.update(task, description=what, completed=done, total=of))
    for table in tables(rows):
        console.print(table)
    write_summary(out / "summary.json", rows)
    console.print(f"{len(rows)} rows in {out / 'quality.jsonl'}, report in {write_report(out, rows)}")


@app.command()
def schema(
    output: Annotated[Path | None, typer.Option("-o", help="File to write; the terminal if left out")] = None,
) -> None:
    """Print the JSON Schema of configurations, for editors."""
    from wall.config.json_schema import schema_text

    if output is None:
        print(schema_text(), end="")
    else:
        _write(output, schema_text())


def _load(path: Path, scene: Path | None):  # type: ignore[no-untyped-def]
    """A configuration, or the default one around a model; `scene` replaces what it shows."""
    from wall.config.loading import default_for_model, load, with_scene

    loaded = default_for_model(path) if path.suffix.lower() in MODEL_SUFFIXES else load(path)
    return with_scene(loaded, scene) if scene is not None else loaded


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        _fail(f"{path}: cannot be written ({error.strerror or error})")


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    width, x, height = text.lower().partition("x")
    if not (x and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ConfigError(f"--size {text}: wanted WIDTHxHEIGHT in pixels, such as 960x540")
    return int(width), int(height)


class _Stages:
    """What a starting run is doing: a line a stage, and a bar while kernels are compiled, where there is a terminal."""

    def __init__(self) -> None:
        columns = (TextColumn("  {task.description}"), BarColumn(), TimeElapsedColumn())
        self._bar = Progress(*columns, console=errors, transient=True, disable=not errors.is_terminal)
        self._task = self._bar.add_task("starting", total=None)
        self._compiling = threading.Event()

    def __enter__(self) -> _Stages:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def say(self, line: str) -> None:
        if not errors.is_terminal or line.startswith("note: "):
            errors.print(f"  {line}", markup=False)
        if line.startswith("starting "):
            self._stop()  # its thread must not be there when processes are forked
        if line.startswith(("starting ", "note: ")):
            return
        self._bar.update(self._task, description=line)
        if line.startswith("compiling") and not self._compiling.is_set():
            self._compiling.set()
            threading.Thread(target=self._follow_compiler, daemon=True).start()

    def _follow_compiler(self) -> None:
        """Move the bar with the kernels that appear in the cache."""
        from wall.core.jit import compiled_kernels, kernels_made

        before = compiled_kernels()
        while self._compiling.is_set():
            self._bar.update(self._task, total=kernels_made(), completed=compiled_kernels() - before)
            time.sleep(0.2)

    def opened(self, address: str, open_page: bool) -> None:
        self._stop()
        if not address:
            console.print("running (Ctrl-C ends the run)")
            return
        console.print(f"watch and steer the wall at [bold]{address}[/] (Ctrl-C ends the run)")
        if open_page and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            webbrowser.open(address)

    def _stop(self) -> None:
        self._compiling.clear()
        self._bar.stop()


def _show_summary(summary: dict, out: Path) -> None:  # type: ignore[type-arg]
    table = Table(title=f"{summary['seconds']:.1f} s, ended: {summary['ended']}", title_justify="left")
    for name in ("rank", "role", "region", "samples/s", "bytes/s", "peak memory"):
        table.add_column(name, justify="left" if name in ("role", "region") else "right")
    for rank in summary["ranks"]:
        table.add_row(
            str(rank["rank"]),
            rank["role"],
            rank["region"],
            _si(rank["samples_per_s"]),
            _si(rank["bytes_per_s"]),
            f"{rank['peak_memory'] / 2**20:.0f} MB",
        )
    console.print(table)
    p50, p95, p99 = (summary["latency_ms"][name] for name in ("p50", "p95", "p99"))
    console.print(
        f"traced {_si(summary['samples_traced'])} samples, shown {_si(summary['samples_shown'])}; "
        f"{_si(summary['packets'])} packets, {_si(summary['bytes'])}B; "
        + (f"input to picture {p50:.1f} ms median, {p95:.1f} p95, {p99:.1f} p99" if p99 else "no input came")
    )
    if summary["dropped"]:
        console.print("dropped: " + ", ".join(f"{name} {count}" for name, count in summary["dropped"].items()))
    console.print(f"results in {out}/")


def _si(value: float) -> str:
    """1234567 as 1.23 M."""
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value:.0f} "


def _fail(message: str) -> NoReturn:
    errors.print(message, style="red", markup=False)
    raise SystemExit(FAILED)


def main() -> None:
    """Entry point: every refusal and failure is one readable text and an exit code."""
    try:
        app()
    except ConfigError as error:
        errors.print(str(error), style="red", markup=False)
        sys.exit(REFUSED)
    except WallError as error:
        _fail(str(error))
    except KeyboardInterrupt:
        _fail("interrupted")
