"""`wall top`, `join`, `doctor`, `examples`: a running wall, a part in it, a machine, and what it may run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from wall.commands.terminal import FAILED, console, load_config


def top(
    address: Annotated[
        str,
        typer.Argument(
            help="Folder of results of a running wall on this machine, or the address of its page or metrics, with "
            "its token where there is one"
        ),
    ] = "OUT",
    every: Annotated[float, typer.Option(min=0.2, max=3600.0, help="Seconds between two looks")] = 1.0,
    once: Annotated[bool, typer.Option("--once", help="Print one table, and end")] = False,
) -> None:
    """Watch a running wall in a terminal: ranks, rates, ages, drops, memory and CPU. Ctrl-C ends it.

    [bold]wall top OUT[/]
    """
    from wall.commands.top import Wall
    from wall.commands.top import top as show

    try:
        show(Wall(address), console, every_s=every, once=once)
    except KeyboardInterrupt:
        raise typer.Exit from None


def join(
    address: Annotated[
        str, typer.Argument(help="Folder of results of the running wall, its control.json, or - for that file's text")
    ] = "OUT",
) -> None:
    """Become a renderer of a running wall, in place of one that is lost; with balance also one more. Ctrl-C leaves it.

    Whoever can read control.json can join. Elsewhere its text comes by ssh, so that nobody else sees it:

    [bold]ssh head.example.org cat wall/OUT/control.json | wall join -[/]
    """
    from wall.commands.join import control_at
    from wall.commands.join import join as become

    console.print(become(control_at(address), lambda line: console.print(line)))


def doctor(
    config: Annotated[
        Path | None, typer.Argument(help="Configuration whose needs are checked, too", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of results of the run that is to come")] = Path("OUT"),
) -> None:
    """Check this machine, or under mpirun all hosts: what is there, what is missing, and how to mend it.

    [bold]wall doctor configs/demo.yaml[/]

    Ends with exit code 1 if something is missing that the configuration needs.
    """
    from wall.commands.doctor.doctor import examine

    loaded = load_config(config) if config is not None else None
    missing = 0
    for host, found in examine(loaded, out):
        console.print(host, style="bold")
        for each in found:
            style = {"ok": "green", "warning": "yellow", "missing": "red"}[each.state]
            console.print(f"  {each.state:8}{each.name}: {each.found}", style=style, soft_wrap=True)
            if each.state != "ok" and each.mend:
                console.print(f"          mend: {each.mend}", soft_wrap=True)
        missing += sum(each.state == "missing" for each in found)
    if missing:
        raise typer.Exit(FAILED)


def examples(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder for a copy; nothing in it is written over", show_default=False)
    ] = None,
) -> None:
    """List the configurations that come with the program, or copy them: the guide's commands on configs/ work there.

    [bold]wall examples configs[/]
    """
    from wall.commands.examples import copy_examples
    from wall.commands.examples import examples as listed

    if folder is not None:
        console.print(f"{copy_examples(folder)} files in {folder}/")
        return
    table = Table(box=None, show_header=False)
    for name, about in listed():
        table.add_row(Text(name, style="bold", no_wrap=True), Text(about))
    console.print(table)
