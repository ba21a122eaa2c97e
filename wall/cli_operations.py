"""`wall top` and `wall doctor`: a run elsewhere, and a machine before a run."""

from __future__ import annotations

from typing import Annotated

import typer

from wall.commands.terminal import console


def top(
    address: Annotated[
        str, typer.Argument(help="Address of the wall's page or metrics, with its token where there is one")
    ],
    every: Annotated[float, typer.Option(min=0.2, max=3600.0, help="Seconds between two looks")] = 1.0,
    once: Annotated[bool, typer.Option("--once", help="Print one table, and end")] = False,
) -> None:
    """Watch a running wall in a terminal: ranks, rates, ages, drops, memory and CPU. Ctrl-C ends it.

    [bold]wall top http://127.0.0.1:8800/[/]
    """
    from wall.commands.top import Wall
    from wall.commands.top import top as show

    try:
        show(Wall(address), console, every_s=every, once=once)
    except KeyboardInterrupt:
        raise typer.Exit from None
