"""The `wall measure` commands: as in cli.py, each reads its options, calls one function and prints the result."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import RenderableType

from wall.commands.terminal import console, end_in_order, errors, fail, load_config, parse_size

T = TypeVar("T")

measure = typer.Typer(no_args_is_help=True, help="Measure this machine and this code.", callback=end_in_order)


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
        fail(f"could not be measured: {', '.join(broken)}")


@measure.command()
def quality(
    configs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[CONFIG]...", help="Scenes to measure on; the project's four if left out"),
    ] = None,
    scenes: Annotated[str, typer.Option(help="Of them only these, such as orbit,light")] = "",
    methods: Annotated[
        str,
        typer.Option(
            "--methods",
            "--arms",
            help="Only these, such as framed,adaptive or 'taa_*'; left out: all but Tapestry, which takes hours",
        ),
    ] = "",
    rates: Annotated[str, typer.Option(help="Rays a second")] = "100k,400k,800k",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the image, pixels")] = "256x256",
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Seeds 1 to N")] = 5,
    out: Annotated[Path, typer.Option(help="Folder of results; what is in it already is not measured again")] = Path(
        "OUT/quality"
    ),
    clock: Annotated[
        str, typer.Option(help="virtual: the same rays for every method; cpu: the same CPU time")
    ] = "virtual",
    cores: Annotated[str, typer.Option(help="With --clock cpu, instead of rates: CPU seconds a second")] = "1,2",
    refresh_hz: Annotated[float, typer.Option(min=1.0, max=1000.0, help="Images shown a second")] = 60.0,
    seconds: Annotated[
        float | None, typer.Option(min=0.2, max=600.0, help="Of a run; 4, or the camera's path, if left out")
    ] = None,
) -> None:
    """Measure speed against error: every way to spend rays, held against the reference image of each refresh.

    [bold]wall measure quality --rates 400k --seeds 1[/]
    """
    from wall.commands.progress import measuring
    from wall.study.quality import command
    from wall.study.quality.report import write_report
    from wall.study.quality.sweep import Wanted, sweep
    from wall.study.quality.tables import tables, write_summary

    command.check_installed()
    wanted = Wanted(
        configs=command.configs_of(configs or [], scenes),
        methods=command.methods_of(methods, clock=clock),
        rates=command.rates_of(rates),
        size=parse_size(size) or (256, 256),
        seeds=tuple(range(1, seeds + 1)),
        out=out,
        clock=clock,
        cores=command.cores_of(cores),
        refresh_hz=refresh_hz,
        seconds=seconds,
    )
    with measuring("{task.description:<24}") as update:
        rows = sweep(wanted, lambda what, done, of: update(description=what, completed=done, total=of))
    for table in tables(rows):
        console.print(table.rich())
    write_summary(out / "summary.json", rows)
    console.print(f"{len(rows)} rows in {out / 'quality.jsonl'}, report in {write_report(out, rows)}")


@measure.command()
def live(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Configurations of walls to run here", show_default=False)
    ],
    methods: Annotated[str, typer.Option(help="Each in turn")] = "adaptive,framed,frameless,hilbert",
    cores: Annotated[str, typer.Option(help="For all processes of a wall, such as 0.5,1,2; all if left out")] = "",
    seconds: Annotated[float, typer.Option(min=0.5, max=600.0, help="Measured, after the warm-up")] = 6.0,
    warm_up: Annotated[float, typer.Option(min=0.0, max=600.0, help="Seconds that a wall runs before")] = 2.0,
    moments: Annotated[int, typer.Option(min=1, max=10000, help="Images compared with the reference")] = 24,
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel of the reference images")] = 64,
    display_delay: Annotated[float | None, typer.Option(min=0.0, help="Seconds from a refresh to its light")] = None,
    rows: Annotated[
        str, typer.Option(help="What renderers make of row_time: known, ignored, or middle: one moment for all rows")
    ] = "known",
    out: Annotated[Path, typer.Option(help="Folder of results; what is in it already is not measured again")] = Path(
        "OUT/live"
    ),
    keep: Annotated[bool, typer.Option("--keep", help="Keep every recorded image too: large")] = False,
) -> None:
    """Measure what is seen: run walls, and compare the image of each moment with the reference image of that moment.

    [bold]wall measure live configs/demo.yaml --cores 2[/]
    """
    from wall.commands.progress import measuring
    from wall.study.live import command
    from wall.study.live.sweep import Wanted, sweep

    command.check_installed()
    wanted = Wanted(
        configs=command.configs_of(configs), methods=command.methods_of(methods), cores=command.cores_of(cores),
        seconds=seconds, warm_up_s=warm_up, moments=moments, spp=spp, display_delay_s=display_delay, out=out, keep=keep,
        rows=command.rows_of(rows),
    )  # fmt: skip
    with measuring("{task.description:<40}") as update:
        outcome = sweep(wanted, lambda what, done, of: update(description=what, completed=done, total=of))
    for item in command.report(outcome, out):
        console.print(item)
    if outcome.failures:
        fail("\n".join(["could not be measured:", *outcome.failures]))


@measure.command()
def response(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Configurations of walls to run here", show_default=False)
    ],
    methods: Annotated[str, typer.Option(help="Each in turn")] = "adaptive,progressive",
    edits: Annotated[int, typer.Option(min=2, max=64, help="Of one parameter, to and fro")] = 24,
    parameter: Annotated[
        str, typer.Option(help="That is edited; a light's or the sky's if left out", show_default=False)
    ] = "",
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/response"),
) -> None:
    """Measure how soon a wall answers: from a parameter's edit to the first changed pixel, from an input to its rays.

    [bold]wall measure response configs/demo.yaml[/]
    """
    from wall.study.live import response

    def measured(config: Path, method: str) -> list[response.Row]:
        return [response.measure(config, method, edits=edits, name=parameter, out=out)]

    _each_run(configs, methods, measured, response.report, out)


@measure.command()
def views(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Configurations of walls to run here", show_default=False)
    ],
    methods: Annotated[str, typer.Option(help="Each in turn")] = "adaptive,framed",
    counts: Annotated[str, typer.Option(help="How many copies of the first view are to fill the wall")] = "1,2,4,8,16",
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Of the runs with one view and with all")] = 3,
    seconds: Annotated[float, typer.Option(min=2.0, max=600.0, help="Of each run")] = 12.0,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/views"),
) -> None:
    """Measure what a view keeps beside others, and the rates of many views on one wall.

    [bold]wall measure views configs/views/map_inset.yaml[/]
    """
    from wall.study.live import views as study

    wanted: dict[str, Any] = {"counts": study.check_counts(counts), "repeats": repeats, "seconds": seconds, "out": out}
    _each_run(configs, methods, lambda config, method: study.measure(config, method, **wanted), study.report, out)


@measure.command()
def updates(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Walls of one renderer to run here", show_default=False)
    ],
    methods: Annotated[str, typer.Option(help="Each in turn")] = "adaptive",
    counts: Annotated[str, typer.Option(help="How many copies of the first view are to fill the wall")] = "1,2,4,8,16",
    rate: Annotated[float, typer.Option(min=1.0, max=10000.0, help="Edits a second")] = 500.0,
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Of each run")] = 1,
    seconds: Annotated[float, typer.Option(min=2.0, max=600.0, help="Of each run")] = 10.0,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/updates"),
) -> None:
    """Measure views at rates of their own while their scene is edited all the time, without and with a barrier.

    [bold]wall measure updates configs/views/four_views.yaml[/]
    """
    from wall.study.live import updates as study
    from wall.study.live.views import check_counts

    wanted: dict[str, Any] = {
        "counts": check_counts(counts), "rate": rate, "repeats": repeats, "seconds": seconds, "out": out,
    }  # fmt: skip
    _each_run(configs, methods, lambda config, method: study.measure(config, method, **wanted), study.report, out)


@measure.command()
def balance(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Configurations of walls to run here", show_default=False)
    ],
    methods: Annotated[str, typer.Option(help="Each in turn")] = "framed,frameless,adaptive",
    ranks: Annotated[str, typer.Option(help="Renderers a panel, each in turn")] = "1,2",
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Of the runs with and without balance")] = 3,
    seconds: Annotated[float, typer.Option(min=4.0, max=600.0, help="Of each run")] = 12.0,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/balance"),
) -> None:
    """Measure how evenly renderers are loaded, with borders that move and without.

    [bold]wall measure balance configs/balance.yaml[/]
    """
    from wall.study.live import balance as study

    wanted: dict[str, Any] = {"ranks": study.check_ranks(ranks), "repeats": repeats, "seconds": seconds, "out": out}
    _each_run(configs, methods, lambda config, method: study.measure(config, method, **wanted), study.report, out)


@measure.command()
def rows(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Walls of displays with a row_time", show_default=False)
    ],
    methods: Annotated[str, typer.Option(help="Each in turn")] = "adaptive,framed,frameless,hilbert,progressive",
    rate: Annotated[float, typer.Option(min=1e3, max=1e9, help="Samples a second of each renderer")] = 400_000.0,
    seconds: Annotated[float, typer.Option(min=0.1, max=600.0, help="Of the camera's path")] = 2.0,
    moments: Annotated[int, typer.Option(min=1, max=10000, help="Images compared with the reference")] = 24,
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel of the reference images")] = 16,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/rows"),
) -> None:
    """Measure what it gains to make each row of a scanning display for the moment when it is seen.

    [bold]wall measure rows configs/scanning_display.yaml[/]
    """
    from wall.study.live import scanning

    scanning.check_installed()
    wanted = scanning.Wanted(out=out, rate=rate, seconds=seconds, moments=moments, spp=spp)
    _each_run(configs, methods, lambda config, method: scanning.measure(config, method, wanted), scanning.report, out)


@measure.command()
def reference(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Walls of one panel, paths traced", show_default=False)
    ],
    spp: Annotated[int, typer.Option(min=16, max=1 << 20, help="Samples a pixel")] = 256,
    own: Annotated[bool, typer.Option("--own-materials", help="Mitsuba's own, which differ by design")] = False,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/reference"),
) -> None:
    """Compare path-traced images with Mitsuba 3's of the same scenes: means, and each pixel against its noise.

    [bold]wall measure reference configs/cornell.yaml --spp 1024[/]
    """
    from wall.study import options
    from wall.study.mitsuba.compare import compare
    from wall.study.mitsuba.report import report

    options.check_installed("wall measure reference", {"mitsuba": "mitsuba"})
    options.check_files(configs)
    with errors.status("comparing") as status:
        rows = [compare(config, spp=spp, out=out, say=status.update, own=own) for config in configs]
    console.print(report(rows, out))
    if not all(row.ok for row in rows):
        fail(f"not the same: {', '.join(row.config for row in rows if not row.ok)}")


@measure.command()
def noise(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Scenes whose paths are traced", show_default=False)
    ],
    spp: Annotated[str, typer.Option(help="Samples a pixel, growing")] = "1,4,16,64,256",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the image, pixels")] = "128x128",
    denoised: Annotated[bool, typer.Option("--denoised", help="Errors of images before and after `denoise`")] = False,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/noise"),
) -> None:
    """Measure how fast the noise of paths falls, against independent samples; or what `denoise` makes of it.

    [bold]wall measure noise configs/paths/cornell.yaml --spp 1,4,16,64[/]
    """
    from wall.study import options
    from wall.study.noise import denoising, points, report

    options.check_installed("wall measure noise", {"scipy": "scipy", "flip_evaluator": "flip-evaluator"})
    options.check_files(configs)
    counts, pixels = options.counts_of("--spp", spp), parse_size(size) or (128, 128)
    out.mkdir(parents=True, exist_ok=True)
    with errors.status("measuring") as status:
        if denoised:
            images = [
                denoising.measure_denoised(config, size=pixels, counts=counts, say=status.update) for config in configs
            ]
            table = report.report_denoised([row for rows in images for row in rows], out)
        else:
            found = [points.measure_points(config, size=pixels, counts=counts, say=status.update) for config in configs]
            table = report.report_points([row for rows in found for row in rows], out)
    console.print(table)


@measure.command()
def features(config: Annotated[Path, typer.Argument(help="A wall; its first view", show_default=False)]) -> None:
    """Measure what features of a scene cost: first its triangles alone, then with one feature more in each row.

    [bold]wall measure features configs/measure/features.yaml[/]
    """
    from wall.commands.costs import one_by_one

    console.print(one_by_one(load_config(config)))


@measure.command()
def accuracy(
    only: Annotated[str, typer.Option(help="Cases by name or pattern, such as 'far_*,scale_*'")] = "",
    long: Annotated[bool, typer.Option("--long", help="Some cases larger: takes many minutes")] = False,
    guide: Annotated[
        Path | None, typer.Option(help="A page whose part about hard cases is written anew from the rows")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/accuracy"),
) -> None:
    """Run every hard case, and hold its figure against its bound. Takes about four minutes.

    [bold]wall measure accuracy --out OUT/accuracy[/]
    """
    from wall.study.accuracy import report, rows
    from wall.study.accuracy.cases import cases_of

    wanted, found, pictures = cases_of(only), [], {}
    with errors.status("measuring") as status:
        for row, images in rows.measure(wanted, long=long, say=lambda name: status.update(f"measuring {name}")):
            found.append(row)
            pictures[row.case] = images
    page = report.write(out, found, pictures)
    if guide is not None:
        report.guide(guide, found)
    console.print(report.table(found))
    outside = [row.case for row in found if not row.ok]
    console.print(f"{len(found)} rows in {out / 'accuracy.jsonl'}, report in {page}")
    if outside:
        console.print(f"outside their bounds: {', '.join(outside)}")


@measure.command()
def page(
    address: Annotated[str, typer.Argument(help="Of the page of a wall that runs", show_default=False)],
    seconds: Annotated[float, typer.Option(min=1.0, max=600.0, help="Of each of the two")] = 10.0,
    drawing: Annotated[float, typer.Option(min=0.0, max=10.0, help="Seconds that a viewer takes to draw")] = 0.0,
) -> None:
    """Measure the bytes that a page gets as images, then as samples of which it makes the images itself.

    [bold]wall measure page http://127.0.0.1:8800/[/]
    """
    from wall.core.errors import RunError
    from wall.display.viewer import watch

    for display in ("images", "samples"):
        try:
            got = watch(address, display=display, seconds=seconds, drawing_s=drawing)
        except RunError as error:
            fail(str(error))
        console.print(f"{display}: {got.words()}")


def _each_run(
    configs: list[Path],
    methods: str,
    measured: Callable[[Path, str], list[T]],
    report: Callable[[list[T], Path], Iterable[RenderableType]],
    out: Path,
) -> None:
    """Measure each configuration under each method, with a line that says which one it is, and print the report."""
    from wall.study.live import command

    found: list[T] = []
    with errors.status("measuring") as status:
        for config, method in command.runs_of(configs, methods):
            status.update(f"measuring {config.stem}, {method}")
            found += measured(config, method)
    for item in report(found, out):
        console.print(item)
