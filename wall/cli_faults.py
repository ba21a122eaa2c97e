"""The `wall measure faults` and `wall measure soak` commands: as in cli_measure.py, which has no room for them."""

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
    hosts: Annotated[
        int, typer.Option(min=0, max=16, help="Start ranks by mpirun on so many hosts made of namespaces; 0: fork them")
    ] = 0,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/faults"),
) -> None:
    """Kill, freeze and slow down processes of running walls, and see what is shown. Takes about three minutes a wall.

    With hosts their network is cut and slowed down, too, and a stranger connects to them: seven minutes.

    [bold]wall measure faults --out OUT/faults[/]
    [bold]wall measure faults --hosts 3[/]
    """
    from wall.study import options
    from wall.study.faults import faults as study

    walls = configs or [study.OWN]
    options.check_files(walls)
    with errors.status("measuring") as status:
        say = status.update
        rows = [row for wall in walls for row in study.measure(wall, seconds=seconds, hosts=hosts, out=out, say=say)]
    for item in study.report(rows, out):
        console.print(item)


def soak(
    config: Annotated[Path | None, typer.Argument(help="A wall to run here; one of the project's")] = None,
    minutes: Annotated[float, typer.Option(min=1.0, max=1440.0, help="How long it runs")] = 30.0,
    seed: Annotated[int, typer.Option(help="Of the choice of processes")] = 1,
    out: Annotated[Path, typer.Option(help="Folder of results")] = Path("OUT/soak"),
) -> None:
    """Run a wall for long with inputs, viewers and a fault a minute: does memory, or anything else, grow?

    [bold]wall measure soak --minutes 120 --out OUT/soak[/]
    """
    from wall.study import options
    from wall.study.faults import soak as study
    from wall.study.faults.faults import OWN

    wall = config or OWN
    options.check_files([wall])
    with errors.status("running") as status:
        rows = study.measure(wall, minutes=minutes, seed=seed, out=out, say=status.update)
    for item in study.report(rows, out):
        console.print(item)
    raise typer.Exit(int(bool(study.judge(rows).why)))
