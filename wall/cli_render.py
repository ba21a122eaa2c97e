"""`wall render`, `wall screenshot` and `wall replay`: converged images, their layers, films; recorded runs again."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from wall.commands.terminal import console, load_config, parse_size
from wall.core.errors import ConfigError

if TYPE_CHECKING:  # what is imported when it is called
    from wall.commands.frames import Quality
    from wall.roles.plan import Plan

Names: TypeAlias = tuple[str, ...]

SIZE_HELP = "WIDTHxHEIGHT in pixels; of the wall's shape if it is not flat, or shows several views; else its own"

UpOption = Annotated[str | None, typer.Option(help="What is up in .obj, .ply, .stl: x, y, z, -x, -y or -z")]
IntegratorOption = Annotated[
    str | None, typer.Option(help="How light is followed: direct, path or ambient_occlusion; else as configured")
]
ViewOption = Annotated[str | None, typer.Option(help="Only this view, as large as its place")]


def render(
    what: Annotated[
        Path,
        typer.Argument(
            metavar="CONFIG|MODEL|NAME", help="A configuration, a model file, or a built-in scene", show_default=False
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="image.png (8-bit sRGB), .exr or .npy (linear float32); frame_####.png"),
    ] = None,
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel")] = 64,
    size: Annotated[str | None, typer.Option(help=SIZE_HELP)] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Same seed, same image")] = 1,
    at: Annotated[float, typer.Option(min=0.0, help="Time of the animation, seconds")] = 0.0,
    view: ViewOption = None,
    up: UpOption = None,
    integrator: IntegratorOption = None,
    exposure: Annotated[float | None, typer.Option(help="Stops: light times 2^EXPOSURE; else as configured")] = None,
    tone_mapping: Annotated[
        str | None, typer.Option(help="none, reinhard, aces or khronos_neutral; else as configured")
    ] = None,
    layers: Annotated[
        str | None,
        typer.Option(help="Layers of an .exr, with commas between: albedo, normal, depth, variance, object_id; or all"),
    ] = None,
    denoise: Annotated[
        bool, typer.Option("--denoise", help="Estimate the image behind the noise: Open Image Denoise, pip: pyoidn")
    ] = False,
    legend: Annotated[
        bool, typer.Option("--legend", help="Draw the legends of the configuration's graph over the image")
    ] = False,
    frames: Annotated[
        str | None, typer.Option(help="FIRST:LAST[:STEP]: many images, of the moments frame number / --rate")
    ] = None,
    rate: Annotated[float, typer.Option(help="Frames a second, with --frames")] = 30.0,
    film: Annotated[Path | None, typer.Option(help="FILE.mp4 of all --frames")] = None,
) -> None:
    """Render one converged image: the same bits for a seed, however many threads or ranks.

    [bold]wall render configs/demo.yaml --spp 64 -o wall.png[/]

    [bold]wall render bunny.glb --integrator path -o bunny.png[/]

    [bold]wall render museum --layers all -o museum.exr[/]

    [bold]wall render configs/demo.yaml --frames 0:119 --rate 30 --film demo.mp4[/]
    """
    from wall.commands.frames import Quality
    from wall.commands.one_view import plan_of_view
    from wall.commands.terminal import print_notes
    from wall.config.loading import with_tone
    from wall.display.image_file import check_suffix
    from wall.roles.plan import make_layout, make_plan
    from wall.sampling.pixel_layers import LAYERS, checked_layers

    names = LAYERS if layers == "all" else checked_layers(layers.split(",") if layers else (), where="--layers")
    quality = Quality(spp=spp, seed=seed, size=parse_size(size))

    def planned() -> Plan:
        loaded = with_tone(load_config(what, up=up, integrator=integrator), exposure, tone_mapping)
        plan = make_plan(make_layout(loaded))
        plan = plan if view is None else plan_of_view(plan, view)
        print_notes(plan)
        return plan

    if frames is None and film is None:
        if output is None:
            raise ConfigError("-o is missing; wanted a file, such as wall.png")
        check_suffix(output, layers=bool(names))
        _render_image(planned, output, quality, at=at, layers=names, denoise=denoise, legend=legend)
        return
    if names or at or denoise:
        other = "--layers" if names else "--at" if at else "--denoise"
        raise ConfigError(f"--frames with {other}: wanted one of them; frames are plain images of moments of their own")
    _render_frames(planned, output, quality, frames=frames, rate=rate, film=film, legend=legend)


def _render_image(
    planned: Callable[[], Plan], output: Path, quality: Quality, *, at: float, layers: Names, denoise: bool,
    legend: bool,
) -> None:  # fmt: skip
    from wall.commands.legends import wanted_legends
    from wall.commands.progress import progress_bar
    from wall.commands.render import render_layers
    from wall.commands.whole_image import display_of, parts_of
    from wall.display.image_file import write_image, write_layers
    from wall.operators.denoise import denoised, load_denoiser

    denoiser = load_denoiser("--denoise") if denoise else None
    needed = tuple(dict.fromkeys((*layers, *(("albedo", "normal") if denoise else ()))))
    with progress_bar("rendering") as update:
        plan = planned()
        over = wanted_legends(plan.layout, quality.size).draw if legend else None
        found = render_layers(
            plan,
            spp=quality.spp,
            seed=quality.seed,
            size=quality.size,
            at=at,
            layers=needed,
            progress=lambda done, total: update(completed=done, total=total),
        )
    if found is None:
        return
    if denoiser is not None:
        found["colour"] = denoised(
            denoiser, found["colour"], found["albedo"], found["normal"], quality="high", who="--denoise"
        )
    image = found["colour"]
    if layers:
        if over is not None:
            over(image)
        write_layers(output, {name: found[name] for name in ("colour", *layers)})
    else:
        parts = parts_of(plan, quality.size, seed=quality.seed)
        display = display_of(parts, [part.event_at(at).tone for part in parts])
        write_image(output, image, display=display, over=over)
    size = f"{image.shape[1]}x{image.shape[0]}"
    console.print(f"wrote {output}: {size}, {quality.spp} samples a pixel, seed {quality.seed}")


def _render_frames(
    planned: Callable[[], Plan], output: Path | None, quality: Quality, *, frames: str | None, rate: float,
    film: Path | None, legend: bool,
) -> None:  # fmt: skip
    from wall.commands.frames import Targets, checked_rate, parse_frames, render_frames
    from wall.commands.legends import wanted_legends
    from wall.commands.progress import progress_bar

    if frames is None or (output is None and film is None):
        raise ConfigError("--frames and --film: wanted --frames FIRST:LAST, and -o frame_####.png or --film film.mp4")
    numbers, targets = parse_frames(frames), Targets(pattern=output, film=film)
    targets.check()
    rate = checked_rate(rate)
    with progress_bar("rendering frames") as update:
        plan = planned()
        if legend:
            targets = replace(targets, over=wanted_legends(plan.layout, quality.size).draw)
        update(total=len(numbers))
        render_frames(plan, quality, numbers, targets, rate=rate, done=lambda count: update(completed=count))
    for name in filter(None, (output, film)):
        console.print(f"wrote {name}: {len(numbers)} frames, {quality.spp} samples a pixel, seed {quality.seed}")


def screenshot(
    config: Annotated[
        Path, typer.Argument(help="Configuration, a YAML file such as configs/demo.yaml", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="wall.png or .tiff (8-bit sRGB), .exr (linear float32)")
    ],
    scale: Annotated[float, typer.Option(min=1e-3, max=1e4, help="Times more pixels each way than the wall has")] = 1.0,
    size: Annotated[
        str | None, typer.Option(help=f"Instead of --scale: {SIZE_HELP}")
    ] = None,
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel")] = 16,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Same seed, same image")] = 1,
    at: Annotated[float, typer.Option(min=0.0, help="Time of the animation, seconds")] = 0.0,
    panels: Annotated[bool, typer.Option("--panels", help="A file for each panel, wall-ID.png, instead")] = False,
    bezels: Annotated[bool, typer.Option("--bezels", help="Dark bezels; else the scene goes on behind them")] = False,
    view: ViewOption = None,
) -> None:
    """Write the whole wall to a file, however large: it is drawn and written strip by strip.

    [bold]wall screenshot configs/demo.yaml --scale 8 -o wall.png[/]
    """
    from wall.commands.progress import progress_bar
    from wall.commands.screenshot import Shot
    from wall.commands.screenshot import screenshot as take

    shot = Shot(size=parse_size(size), scale=scale, spp=spp, seed=seed, at=at, panels=panels, bezels=bezels, view=view)
    with progress_bar("rendering", count="{task.completed} of {task.total} rows") as update:
        written = take(load_config(config), output, shot, lambda done, total: update(completed=done, total=total))
    for one in written:
        console.print(f"wrote {one.path}: {one.width}x{one.height}, {spp} samples a pixel, seed {seed}")


def replay(
    folder: Annotated[Path, typer.Argument(help="What wall run --record wrote", show_default=False)],
    rank: Annotated[list[int] | None, typer.Option(help="Only this rank; may be given several times")] = None,
    batch: Annotated[
        str | None,
        typer.Option(metavar="NUMBER[@LIFE]", help="Show this batch of one --rank; LIFE: restarts of the rank before"),
    ] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="FILE.npy for samples of --batch")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; one a core if left out")] = None,
    film: Annotated[
        Path | None, typer.Option(help="FILE.mp4 of what the run was to show, rendered anew; no samples are replayed")
    ] = None,
    rate: Annotated[float, typer.Option(help="Frames a second of --film")] = 30.0,
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel of --film")] = 16,
    size: Annotated[str | None, typer.Option(help=f"Of --film: {SIZE_HELP}")] = None,
    view: ViewOption = None,
) -> None:
    """Trace a recorded run again: the same samples, bit for bit, or an error that names the first batch that differs.

    [bold]wall run configs/demo.yaml --seconds 10 --record run.events[/]

    [bold]wall replay run.events[/], [bold]wall replay run.events --rank 2 --batch 117[/]

    [bold]wall replay run.events --film run.mp4 --rate 60 --size 1920x1080 --spp 64[/]
    """
    ranks = tuple(rank or ())
    if film is not None and (ranks or batch is not None or output is not None):
        raise ConfigError("--film shows the whole run; wanted no --rank, --batch or -o with it")
    if batch is not None and len(ranks) != 1:
        raise ConfigError("--batch: wanted exactly one --rank with it")
    if output is not None and batch is None:
        raise ConfigError("-o: wanted --batch with it")
    if film is not None:
        from wall.commands.film import make_film
        from wall.commands.frames import Quality

        make_film(folder, film, Quality(spp=spp, seed=1, size=parse_size(size)), rate=rate, view=view)
        return
    from wall.commands.progress import StartProgress
    from wall.commands.replay import replay as replay_run
    from wall.commands.replay import replay_one

    with StartProgress(open_page=False) as progress:
        if batch is None:
            found = list(replay_run(folder, ranks=ranks, jobs=jobs, say=progress.say))
        else:
            number, life = _batch_of(batch)
            found = list(replay_one(folder, ranks[0], number, output, progress.say, life=life))
    for item in found:
        console.print(item, soft_wrap=isinstance(item, str))


def _batch_of(text: str) -> tuple[int, int]:
    """The number of a batch, and how often its rank had been started again before."""
    found = re.fullmatch(r"(\d+)(?:@(\d+))?", text)
    if found is None:
        raise ConfigError(f"--batch {text!r}: wanted a number such as 117, or 117@1 after a rank's first restart")
    return int(found[1]), int(found[2] or 0)
