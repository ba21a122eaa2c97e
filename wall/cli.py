"""The `wall` command line: each command reads its options, calls one function and prints the result.

Exit codes: 0 ok, 1 the run failed, 2 the configuration or the edit was refused. Each command imports what it runs when
it is called, so that `wall --help` loads nothing but the command line itself.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from wall.cli_faults import faults, soak
from wall.cli_measure import measure
from wall.cli_operations import doctor, examples, join, top
from wall.cli_peers import peers
from wall.cli_plan import plan
from wall.cli_render import IntegratorOption, UpOption, render, replay, screenshot
from wall.cli_tracker import tracker
from wall.commands.terminal import console, errors, fail, load_config, readably, say_version, write_text
from wall.core.errors import ConfigError, EditError, WallError

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A ray-traced display wall: every process renders its own part of it, nothing waits for a frame.\n\n"
    "Try [bold]wall run configs/demo.yaml[/], then open the address it prints. "
    "[bold]wall check[/] says what a configuration does before it does it.",
)
measure.command()(faults)
measure.command()(soak)
measure.command()(peers)
app.add_typer(measure, name="measure")
app.command()(plan)
app.command()(render)
app.command()(replay)
app.command()(screenshot)
app.command()(top)
app.command()(join)
app.command()(doctor)
app.command()(examples)
app.command()(tracker)

ConfigArgument = Annotated[
    Path, typer.Argument(help="Configuration, a YAML file such as configs/demo.yaml", show_default=False)
]
VersionOption = Annotated[
    bool, typer.Option("--version", callback=say_version, is_eager=True, help="Say which version this is")
]


@app.callback()
def options(version: VersionOption = False) -> None:
    """Options of `wall` itself."""


@app.command()
def run(
    config: ConfigArgument,
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Stop after so many seconds; without it, run until Ctrl-C")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for wall.png, panel-ID.png and summary.json")] = None,
    scene: Annotated[Path | None, typer.Option(help="Show this model instead: .glb, .gltf, .obj, .ply or .stl")] = None,
    up: UpOption = None,
    integrator: IntegratorOption = None,
    headless: Annotated[bool, typer.Option("--headless", help="No browser page")] = False,
    still: Annotated[bool, typer.Option("--still", help="Begin paused, at time 0")] = False,
    until_complete: Annotated[
        bool, typer.Option("--until-complete", help="Show time 0 and stop when the image has all its samples")
    ] = False,
    record: Annotated[
        Path | None, typer.Option(help="Folder for the run's events, such as run.events; wall replay traces them again")
    ] = None,
    film: Annotated[
        Path | None, typer.Option(help="FILE.mp4 of what the run was to show, rendered after it")
    ] = None,
    film_view: Annotated[str | None, typer.Option(help="View of --film; all if left out")] = None,
    film_rate: Annotated[float, typer.Option(help="Frames a second of --film")] = 30.0,
    film_spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel of --film")] = 16,
    images: Annotated[
        Path | None, typer.Option(help="Folder that keeps every image shown, lossless: large, for short runs")
    ] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Adopt CONFIG again whenever its file is saved")] = False,
    fit: Annotated[bool, typer.Option("--fit", help="Fewer pixels where a grid has more panels than cores")] = False,
) -> None:
    """Run a wall: start its processes here, or use the ranks that mpirun made.

    [bold]wall run configs/demo.yaml --seconds 20[/]

    [bold]wall run configs/demo.yaml --seconds 10 --film demo.mp4[/]

    [bold]mpirun --with-ft ulfm -x PATH -n 5 wall run configs/demo.yaml --headless --seconds 20[/]
    """
    from wall.commands.progress import StartProgress, show_summary
    from wall.run import launch

    if watch and (record or film):
        option = "--film" if record is None else "--record"
        raise ConfigError(f"{option} and --watch: a run that is recorded keeps its configuration; wanted: one of them")
    if film_view is not None and film is None:
        raise ConfigError(f"--film-view {film_view}: wanted --film FILE.mp4 with it")
    loaded = load_config(config, scene, up=up, integrator=integrator, fit=fit)
    options = launch.Options(
        out=out or Path(loaded.config.output.directory),
        seconds=seconds,
        headless=headless,
        until_complete=until_complete,
        still=still or until_complete,
        record=record,
        images=images,
        watch=watch,
    )
    film_later = None
    if film is not None:
        from wall.commands.film import film_of_run

        views = [view.id for view in loaded.config.views]
        film_later = film_of_run(film, record, views, rate=film_rate, spp=film_spp, view=film_view)
        options = replace(options, record=film_later.events)
    try:
        with StartProgress(open_page=loaded.config.output.browser.open) as progress:
            outcome = launch.run(loaded, options, progress.say, progress.opened)
    except WallError:
        if film_later is not None:  # or the next run would be refused for what this one has begun
            film_later.drop()
        raise
    if outcome is None:
        return
    show_summary(outcome.summary, options.out)
    if film_later is not None:
        film_later.make()
    if outcome.failed:
        fail(f"the run failed: {outcome.failed}")


@app.command()
def demo(
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Stop after so many seconds; without it, run until Ctrl-C")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for wall.png, panel-ID.png and summary.json")] = None,
    scene: Annotated[Path | None, typer.Option(help="Show this model, or built-in scene, instead")] = None,
    integrator: IntegratorOption = None,
    headless: Annotated[bool, typer.Option("--headless", help="No browser page")] = False,
) -> None:
    """Run the demo, wherever you are: a wall of four panels, with fewer pixels where there are fewer cores.

    [bold]wall demo --seconds 20[/]
    """
    from wall.commands.inputs import DEMO

    run(DEMO, seconds=seconds, out=out, scene=scene, integrator=integrator, headless=headless, fit=True)


@app.command(name="set")
def set_command(
    assignments: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME=VALUE...", help="Parameters and what they are to be; of --list: names"),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of results of the running wall: its --out")] = Path("OUT"),
    listed: Annotated[
        bool, typer.Option("--list", help="Show parameters, their values and ranges: all, or those named")
    ] = False,
    undo: Annotated[int, typer.Option(min=0, help="Take back so many edits, the newest first")] = 0,
) -> None:
    """Change parameters of a running wall: all that are named, or, if one is refused, none.

    A value is a number, numbers with commas between, a colour #rrggbb, or `default`.

    [bold]wall set --list[/], [bold]wall set --list 'lights.*'[/]

    [bold]wall set exposure=1 lights.0.intensity=8,7,5[/]
    """
    from wall.commands.set import lines_of, note_of, set_parameters

    if not assignments and not listed and not undo:
        raise EditError("nothing to set: want NAME=VALUE, --undo 1 or --list")
    answer = set_parameters(out, assignments or [], listed=listed, undo=undo)
    if listed:
        print("\n".join(lines_of(answer.parameters)))
        if note := note_of(answer):
            errors.print(f"note: {note}")
        if all("=" in text for text in assignments or ()):
            errors.print("note: wall set --list 'objects.*' shows those of objects")
    if undo or any("=" in text for text in assignments or ()):
        console.print(f"set by edit {answer.edit}")


@app.command()
def load(
    config: ConfigArgument,
    out: Annotated[Path, typer.Option(help="Folder of results of the running wall: its --out")] = Path("OUT"),
) -> None:
    """Let a running wall adopt another configuration: other models, objects, views, calibration.

    It goes on meanwhile. Its processes and displays stay; what needs others is refused, and changes nothing.

    [bold]wall load configs/demo.yaml[/]
    """
    from time import monotonic

    from rich.text import Text

    from wall.client import connect

    began = monotonic()
    with connect(out) as run, errors.status(Text(f"the wall goes on while every rank prepares {config}")):
        edit = run.load(config)
    console.print(f"{config}: adopted after {monotonic() - began:.1f} s, by edit {edit}")


@app.command()
def edit(
    changes: Annotated[
        list[str], typer.Argument(metavar="PATH=VALUE...", help="What changes; += adds to a list, -= removes from it")
    ],
    out: Annotated[Path, typer.Option(help="Folder of results of the running wall: its --out")] = Path("OUT"),
) -> None:
    """Change the configuration of a running wall, all that is named or nothing: objects, views, panels.

    Paths are keys with dots; entries of lists go by number or id; values are YAML. `wall set --undo 1` takes it back.

    [bold]wall edit scene.source+=chair.glb[/], [bold]wall edit views-=map views.main.refresh_hz=60[/]
    """
    from time import monotonic

    from wall.client import connect

    began = monotonic()
    with connect(out) as run, errors.status("the wall goes on while every rank prepares that"):
        number = run.edit(*changes)
    console.print(f"adopted after {monotonic() - began:.1f} s, by edit {number}")


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

    page = draw_wall(load_config(config), output, samples_per_s=samples_per_s, width=width)
    console.print(f"wrote {output}: {page.width:.0f} x {page.height:.0f} mm")


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
        files = write_patterns(load_config(config), pattern, output)
        console.print(f"wrote {len(files)} files to {output}/")
        return
    show_patterns(load_config(config), pattern, seconds=seconds, say=lambda line: console.print(line))


@app.command()
def check(
    config: ConfigArgument,
    costs: Annotated[
        bool, typer.Option("--costs", help="Measure what each feature of the scene costs, by leaving it out")
    ] = False,
) -> None:
    """Check a configuration, and say what would run where, with what, at what cost.

    [bold]wall check configs/demo.yaml --costs[/]
    """
    from wall.commands.check import check as check_config

    for item in check_config(load_config(config), costs=costs):
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
    from wall.geometry.expanding import expanded_config

    loaded = load(config)
    text = with_wall(loaded, expanded_config(loaded.config.wall))
    if output is None:
        print(text, end="")
        return
    write_text(output, text)
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
    """Convert a wall of ParaView, Tide, DisplayCluster, SGCT, SAGE2, Equalizer or MPCDI to a configuration.

    [bold]wall convert cave.pvx -o cave.yaml --report cave.json[/]
    """
    from wall.importers import command

    command.check_outputs(file, output, report)
    chosen, conversion, yaml = command.convert_file(file, format_name, f"{output.stem}_files")
    command.write_conversion(output, yaml, conversion)
    if report is not None:
        command.write_report(report, conversion)
    left_out = command.table(conversion)
    if left_out is not None:
        console.print(left_out)
    console.print(
        f"wrote {output} from {chosen.name}: {conversion.panels} panels, {conversion.ranks} ranks; "
        f"{len(conversion.carried)} values carried, {len(conversion.not_carried)} not"
    )
    for sentence in conversion.assumed:
        console.print(f"note: {sentence}", soft_wrap=True)


@app.command()
def tiles(
    image: Annotated[Path, typer.Argument(help="A PNG, JPEG or TIFF file", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Deep Zoom Image to write, NAME.dzi")],
    tile_format: Annotated[str, typer.Option("--format", help="jpg; or png: without loss, with alpha")] = "jpg",
) -> None:
    """Cut a very large image into tiles, for `deep_zoom` nodes and other viewers of Deep Zoom Images.

    [bold]wall tiles map.tif -o map.dzi[/]
    """
    from wall.commands.progress import progress_bar
    from wall.commands.tiles import TILE, cut_up, format_of

    with progress_bar("cutting up") as advance:
        shape = cut_up(image, output, format_of(tile_format), lambda done, total: advance(completed=done, total=total))
    console.print(f"wrote {output}: {shape.width}x{shape.height}, {shape.top + 1} levels of {TILE}x{TILE} tiles")


@app.command()
def schema(
    output: Annotated[Path | None, typer.Option("-o", help="File to write; the terminal if left out")] = None,
) -> None:
    """Print the JSON Schema of configurations, for editors."""
    from wall.config.json_schema import schema_text

    if output is None:
        print(schema_text(), end="")
    else:
        write_text(output, schema_text())


def main() -> None:
    """Entry point: every refusal and failure is one readable text and an exit code."""
    readably(app)
