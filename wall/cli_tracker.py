"""The `wall tracker` command: as in cli.py, it reads its options, calls one function and prints the result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wall.commands.terminal import console, load_config


def tracker(
    config: Annotated[Path, typer.Argument(help="Configuration with tracking in a view", show_default=False)],
    to: Annotated[str, typer.Option(help="Machine of the wall's head")] = "127.0.0.1",
    view: Annotated[str | None, typer.Option(help="View whose viewer moves; else the first that is tracked")] = None,
    path: Annotated[
        Path | None, typer.Option(help="Recorded movement, lines time,x,y,z: s, m in the wall's frame; else a sway")
    ] = None,
    rate: Annotated[float, typer.Option(min=1.0, max=1000.0, help="Packets a second")] = 100.0,
    noise: Annotated[float, typer.Option(min=0.0, max=1.0, help="Of each coordinate, m, standard deviation")] = 0.0,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Else until Ctrl-C")] = None,
) -> None:
    """Be the head tracker of a running wall: send how a viewer moves, as the configuration expects it.

    [bold]wall tracker configs/tracked.yaml --seconds 20[/]
    """
    from wall.commands import tracker as simulated

    tracking, eye = simulated.tracked_view(load_config(config), view)
    movement = simulated.sway(eye) if path is None else simulated.recorded(path)
    packets = simulated.packets(tracking, movement, rate=rate, noise_m=noise)
    console.print(f"sending {tracking.address} to {to}, UDP port {tracking.port}, {rate:g} times a second")
    console.print(f"sent {simulated.send(packets, (to, tracking.port), rate=rate, seconds=seconds)} packets")
