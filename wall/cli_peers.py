"""The `wall measure peers` command: as in cli_measure.py, which has no room for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from wall.commands.terminal import console, fail, parse_size


def peers(
    configs: Annotated[
        list[Path], typer.Argument(metavar="CONFIG...", help="Scenes to draw, on one panel", show_default=False)
    ],
    renderers: Annotated[
        str, typer.Option(help="Samplers of walls, and others; with _ahead they foresee the camera")
    ] = "adaptive,framed,mitsuba,open3d,pyvista",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the panel, pixels")] = "480x270",
    cores: Annotated[str, typer.Option(help="For each renderer, such as 0.5,1,2; all if left out")] = "",
    seconds: Annotated[float, typer.Option(min=0.5, max=600.0, help="Measured, after the warm-up")] = 6.0,
    warm_up: Annotated[float, typer.Option(min=0.0, max=600.0, help="Seconds that a renderer runs before")] = 2.0,
    moments: Annotated[int, typer.Option(min=1, max=10000, help="Images compared with the reference")] = 24,
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel of the reference images")] = 64,
    out: Annotated[Path, typer.Option(help="Folder of results; what is in it already is not measured again")] = Path(
        "OUT/peers"
    ),
) -> None:
    """Measure other renderers beside this one: the same triangles, pixels and moving camera on the same cores.

    [bold]wall measure peers configs/one_panel.yaml --cores 1,2[/]
    """
    from wall.commands.progress import measuring
    from wall.study.live.command import cores_of
    from wall.study.peers import command

    wanted = command.wanted_of(configs, renderers, parse_size(size) or (480, 270))
    wanted = replace(
        wanted, cores=cores_of(cores), seconds=seconds, warm_up_s=warm_up, moments=moments, spp=spp, out=out
    )  # fmt: skip
    with measuring("{task.description:<40}") as update:
        outcome = command.sweep(wanted, lambda what, done, of: update(description=what, completed=done, total=of))
    for item in command.report(outcome, out):
        console.print(item)
    if outcome.failures:
        fail("\n".join(["could not be measured:", *outcome.failures]))
