"""The `wall measure faults` command: as in cli_measure.py, which has no room for it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wall.commands.terminal import console, errors


def faults(
    configs: Annotated[
        list[Path] | None, typer.Argument(metavar="[CONFIG]...", help="Walls to run here; one of the project's")
    ] = None,
    seconds: Annotated[float, typer.Option(min=2.0, max=20.0, help="Watched before and after each fault")] = 4.0,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/faults"),
) -> None:
    """Kill, freeze and slow down processes of running walls, and see what is shown. Takes about three minutes a wall.

    [bold]wall measure faults --out OUT/faults[/]
    """
    from wall.study import options
    from wall.study.faults import faults as study

    walls = configs or [study.OWN]
    options.check_files(walls)
    with errors.status("measuring") as status:
        rows = [row for wall in walls for row in study.measure(wall, seconds=seconds, out=out, say=status.update)]
    for item in study.report(rows, out):
        console.print(item)
