"""`wall top`: a table of a running wall, kept up to date in the terminal, from its `/status.json`."""

from __future__ import annotations

import json
import math
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from rich.cells import cell_len
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from wall.commands.terminal import Terminal, si, spelled_out
from wall.core.errors import ConfigError, RunError
from wall.run.control_file import read

ANSWER_S = 3.0  # for the wall's answer
MOST_BYTES = 16 << 20  # of it
TRIES = 3  # answers that may be missed before a run counts as gone
COLUMNS = (
    "rank", "role", "region", "host", "PID", "samples/s", "bytes/s", "oldest", "heard", "dropped", "memory", "cores",
)  # fmt: skip
REGION_WIDTH = 20  # columns that a region has at least
LEFT_OUT = ("bytes/s", "dropped", "heard", "PID", "host", "memory", "role")  # on narrow terminals, the first first
UNKNOWN = "-"  # in place of the rates of a rank that is not heard of
STALE_S = 2.0  # an older sample is marked
Status = Mapping[str, Any]  # of /status.json


def _address_in(folder: Path) -> str:
    """The address of the page, or the metrics, of the wall that writes its results to a folder. Raises RunError."""
    if not (page := read(folder).page):
        raise RunError(
            f"{folder}: that wall has no page; wanted: output.metrics in its configuration, or no --headless"
        )
    return page


class Wall:
    """A run's status, by its folder of results or its address."""

    def __init__(self, address: str) -> None:
        """`address`: with its token, where there is one; or the run's folder of results.

        Raises ConfigError for what is neither, RunError where no wall with a page runs in that folder.
        """
        if "//" not in address and (Path(address).is_dir() or not {".", ":"} & set(address.partition("/")[0])):
            address = _address_in(Path(address))
        text = address if "//" in address else f"http://{address}"
        try:
            parts = urlsplit(text)
            good = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
        except ValueError:
            good = False
        if not good:
            raise ConfigError(
                f"{address}: no address of a page; wanted: http://HOST:PORT/?token=... as the run printed"
            )
        self.name = f"{parts.scheme}://{parts.netloc}/"
        self._url = parts._replace(path="/status.json", fragment="").geturl()

    def status(self) -> Status | None:
        """How the run is doing; None: it has shown nothing yet. Raises RunError where nobody answers as a wall does."""
        try:
            with urllib.request.urlopen(self._url, timeout=ANSWER_S) as response:
                values = json.loads(response.read(MOST_BYTES))
        except urllib.error.HTTPError as error:
            if error.code == 503:
                return None
            said = error.read(200).decode(errors="replace").strip()
            raise RunError(f"{self.name} refuses: {said or error.reason}") from error
        except (OSError, ValueError) as error:
            raise RunError(f"{self.name}: {getattr(error, 'reason', error)}") from error
        if not isinstance(values, dict) or not {"ranks", "totals", "seconds"} <= values.keys():
            raise RunError(f"{self.name} answers, but not as a wall of this version does")
        return values


def top(
    wall: Wall, terminal: Terminal, *, every_s: float, once: bool, sleep: Callable[[float], None] = time.sleep
) -> None:
    """Show the run until it is gone, or Ctrl-C. Raises RunError where it is gone, or was never there.

    `once`: print one table, whose CPU time is that of `every_s`.
    """
    before, missed = wall.status(), 0
    if once or not terminal.is_terminal:
        sleep(every_s)
        terminal.print(view_of(wall.name, wall.status(), before, width=terminal.width))
        return
    with Live(
        view_of(wall.name, before, None, width=terminal.width), console=terminal, auto_refresh=False, screen=True
    ) as live:
        while True:
            sleep(every_s)
            try:
                now, missed = wall.status(), 0
            except RunError as error:
                missed += 1
                if missed >= TRIES:
                    raise RunError(f"the run is gone, or cannot be reached any more: {error}") from error
                view = view_of(wall.name, before, None, width=terminal.width)
                live.update(Group(view, Text(f"no answer: {error}", "red")), refresh=True)
                continue
            live.update(view_of(wall.name, now, before, width=terminal.width), refresh=True)
            before = now


def view_of(name: str, now: Status | None, before: Status | None, *, width: int = 200) -> Group:
    """What is shown of a status on `width` columns; `before`: an earlier one, from which rates are."""
    if now is None:
        return Group(Text(f"{name}: no image yet"))
    parts: list[Text | Table] = [Text(spelled_out(_headline(name, now))), _table(now, before, width)]
    dropped = "; ".join(
        f"rank {rank['rank']}: " + ", ".join(f"{why} {count}" for why, count in sorted(totals["dropped"].items()))
        for rank, totals in zip(now["ranks"], now["totals"], strict=True)
        if totals["dropped"]
    )
    parts += [Text(spelled_out(text), style) for text, style in _lines(now, dropped)]
    return Group(*parts)


def _headline(name: str, now: Status) -> str:
    p50, p95, _ = now["latency_ms"]
    latency = f"input to image {p50:.0f} ms, 95 % within {p95:.0f} ms" if p95 else "no input yet"
    there = sum(rank["alive"] for rank in now["ranks"])
    return (
        f"{name}  {_duration(now['seconds'])}  {there} of {len(now['ranks'])} ranks  {now['refreshes_per_s']:.1f} Hz  "
        f"{latency}  {now['viewers']} viewers" + ("  paused" if now["paused"] else "")
    )


def _lines(now: Status, dropped: str) -> list[tuple[str, str]]:
    """What is told below the table, with its style."""
    lines = [(f"dropped: {dropped}", "")] if dropped else []
    lines += [(now["slow"], "yellow")] if now["slow"] else []
    return lines + [(note, "") for note in now["notes"]]


def _table(now: Status, before: Status | None, width: int) -> Table:
    """A row a rank; on a terminal that is too narrow without those columns of LEFT_OUT that do not fit."""
    earlier: list[Mapping[str, Any] | None] = list(before["totals"]) if before is not None else []
    earlier += [None] * (len(now["ranks"]) - len(earlier))
    rows, styles = list[tuple[str, ...]](), list[str]()
    for rank, totals, then in zip(now["ranks"], now["totals"], earlier, strict=False):
        oldest = rank["oldest_sample_s"]
        rates = (si(rank[each]) if rank["alive"] else UNKNOWN for each in ("samples_per_s", "bytes_per_s"))
        cells = (
            str(rank["rank"]), rank["role"], rank["region"], totals["host"], str(totals["process"] or ""), *rates,
            "" if oldest is None else f"{oldest:.1f} s", f"{totals['silent_s']:.1f} s",
            str(rank["dropped"]), f"{totals['memory'] / 2**20:.0f} MB", _cores(totals, then),
        )  # fmt: skip
        old = oldest is not None and oldest > STALE_S and not now["paused"]
        styles.append("red" if not rank["alive"] else "yellow" if old else "")
        rows.append(tuple(map(spelled_out, cells)))
    columns = zip(COLUMNS, *rows, strict=True)
    widths = {name: max(map(cell_len, (name, *cells))) for name, *cells in columns}
    widths["region"] = min(widths["region"], REGION_WIDTH)  # of several views it is long, and takes several lines then
    shown = list(COLUMNS)
    for name in LEFT_OUT:
        if sum(widths[each] + 2 for each in shown) - 2 > width:
            shown.remove(name)
    table = Table(box=None, pad_edge=False)
    for name in shown:
        left, folds = name in ("role", "region", "host"), name == "region"
        table.add_column(name, justify="left" if left else "right", no_wrap=not folds, overflow="fold")
    for row, style in zip(rows, styles, strict=True):
        by_name = dict(zip(COLUMNS, row, strict=True))
        table.add_row(*(Text(by_name[name], style) for name in shown))
    return table


def _cores(now: Mapping[str, Any], before: Mapping[str, Any] | None) -> str:
    """Cores that a rank has used between two statuses; "" where that is not known."""
    span = now["seconds"] - before["seconds"] if before is not None else 0.0
    used = now["cpu_s"] - before["cpu_s"] if before is not None else 0.0
    return f"{used / span:.2f}" if span > 0.0 and used >= 0.0 else ""


def _duration(seconds: float) -> str:
    minutes, rest = divmod(math.floor(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    return (f"{days} d " if days else "") + f"{hours}:{minutes:02d}:{rest:02d}"
