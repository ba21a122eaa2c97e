"""The `wall plan` command: as in cli.py, it reads its options, calls one function and prints the result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wall.commands.terminal import console, errors, load_config


def plan(
    config: Annotated[Path | None, typer.Argument(help="Configuration of a wall; else say what it is like")] = None,
    pixels: Annotated[float | None, typer.Option(min=1.0, help="Of the wall, such as 7.2e9")] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT of the wall, metres")] = None,
    dpi: Annotated[float | None, typer.Option(min=1.0, help="Pixels an inch")] = None,
    hz: Annotated[float, typer.Option(min=0.1, max=10000.0, help="Refreshes a second")] = 60.0,
    distance: Annotated[float, typer.Option(min=0.01, help="From the eye to the wall, metres")] = 0.4572,
    texts: Annotated[bool, typer.Option("--texts", help="Walls of 455 Mpixel, 670 Mpixel and 7.2 Gpixel")] = False,
    simulate: Annotated[
        float, typer.Option(min=0.0, max=600.0, help="Simulate so many seconds; with --texts: of 1,000 ranks")
    ] = 0.0,
    runs: Annotated[str, typer.Option(help="Run CONFIG here with so many renderers and compare: 1,2,4,8,16")] = "",
    rates: Annotated[Path | None, typer.Option(help="JSON of measured rates; else measured now")] = None,
    save_rates: Annotated[Path | None, typer.Option(help="File for the rates that were measured")] = None,
    cores: Annotated[float, typer.Option(min=0.01, help="Of each renderer and each compositor")] = 1.0,
    gbit: Annotated[float, typer.Option(min=1e-3, help="Of a machine's link, Gbit/s")] = 10.0,
    fewer: Annotated[
        float, typer.Option(min=1.0, help="Times fewer samples of adaptive sampling at the same error")
    ] = 10.0,
    out: Annotated[Path, typer.Option(help="Folder for plan.html and plan.json")] = Path("OUT/plan"),
) -> None:
    """Say what a wall needs, before there is one: acuity, samples, bytes, ranks, links, latency; simulate its run.

    [bold]wall plan configs/walls/large.yaml --rates rates.json[/]

    [bold]wall plan --pixels 7.2e9 --dpi 600 --hz 240[/], [bold]wall plan --texts --simulate 2[/]
    """
    from wall.study.plan import command, report
    from wall.study.plan.budget import Machines
    from wall.study.plan.rates import save
    from wall.study.plan.target import Given

    machines = Machines(cores_a_rank=cores, cores_a_compositor=cores, link_bytes_per_s=gbit * 1e9 / 8)
    wanted = command.Wanted(
        loaded=None if config is None else load_config(config),
        given=Given(pixels=pixels, size=command.size_of(size), dpi=dpi, hz=hz, distance=distance),
        machines=machines, texts=texts, fewer=fewer, rates=rates, simulate_s=simulate, runs=command.runs_of(runs),
    )  # fmt: skip
    with errors.status("planning") as status:
        found = command.plan(wanted, status.update)
    if save_rates is not None:
        save(save_rates, found.rates)
    for grid in report.grids(found):
        console.print(grid.rich())
    for path in report.write(found, out):
        console.print(f"wrote {path}")
