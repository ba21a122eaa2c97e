"""Progress bars of the commands, and the table that ends a run."""

from __future__ import annotations

import os
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from wall.commands.terminal import console, errors, si, spelled_out

LINE_S = 10.0  # between lines of a measurement where no bar can be shown
POLL_S = 0.2  # between looks at the cache of compiled kernels


@contextmanager
def progress_bar(
    title: str = "{task.description}", *, count: str | None = None
) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error, if that is a terminal; yields a function that takes `completed=`,
    `total=`, `description=`.

    `title` and `count` are the texts before and after the bar; `count` defaults to done/total.
    """
    counted = MofNCompleteColumn() if count is None else TextColumn(count, markup=False)
    columns = TextColumn(title, markup=False), BarColumn(), counted, TimeElapsedColumn(), TextColumn("left")
    with Progress(*columns, TimeRemainingColumn(), console=errors, disable=not errors.is_terminal) as bar:
        task = bar.add_task("starting", total=None)
        try:
            yield lambda **values: bar.update(task, **values)
        except BaseException:
            bar.live.transient = True  # no half of a bar stays before the error
            raise


@contextmanager
def measuring(title: str) -> Iterator[Callable[..., None]]:
    """A progress bar; where standard error is no terminal, a line now and then: measurements take hours."""
    if errors.is_terminal:
        with progress_bar(title) as advance:
            yield advance
        return
    said = -LINE_S

    def update(*, description: str, completed: int, total: int) -> None:
        nonlocal said
        if time.monotonic() - said >= LINE_S or completed == total:
            said = time.monotonic()
            errors.print(f"{completed} of {total}: {description}", soft_wrap=True)

    yield update


class StartProgress:
    """Shows the stages of a starting run: a line each, and on a terminal a bar while kernels are compiled."""

    def __init__(self, *, open_page: bool) -> None:
        """`open_page`: whether a run's address is opened in a browser where there is a display."""
        columns = (TextColumn("  {task.description}", markup=False), BarColumn(), TimeElapsedColumn())
        self._bar = Progress(*columns, console=errors, transient=True, disable=not errors.is_terminal)
        self._task = self._bar.add_task("starting", total=None)
        self._compiling = threading.Event()
        self._open_page = open_page

    def __enter__(self) -> StartProgress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def say(self, line: str) -> None:
        """Show a stage, or a line that begins with `note: `."""
        if not errors.is_terminal or line.startswith("note: "):
            style = "red" if line.startswith("note: refused") else None
            errors.print(f"  {line}", soft_wrap="://" in line, style=style)  # an address in two lines is none
        if line.startswith("starting "):
            self._stop()  # the bar's thread must not exist when processes are forked
        if line.startswith(("starting ", "note: ")):
            return
        self._bar.update(self._task, description=spelled_out(line))
        if line.startswith("compiling") and not self._compiling.is_set():
            self._compiling.set()
            threading.Thread(target=self._follow_compiler, daemon=True).start()

    def opened(self, address: str) -> None:
        """Say that the wall runs, and where its page is; opens the page if wanted."""
        self._stop()
        if not address:
            console.print("running (Ctrl-C ends the run)")
            return
        line = Text.assemble("watch and steer the wall at ", (address, "bold"), " (Ctrl-C ends the run)")
        console.print(line, soft_wrap=True)
        if "?" in address:
            return  # a command that opens it would show its token to all users of this machine
        if self._open_page and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            webbrowser.open(address)

    def _follow_compiler(self) -> None:
        """Advance the bar with the kernels that appear in the cache; it has no end where about as many were there."""
        from wall.core.jit import kernels_made
        from wall.core.kernel_cache import compiled_kernels

        before = compiled_kernels()
        while self._compiling.is_set():
            missing = kernels_made() - before
            self._bar.update(self._task, total=missing if missing > 0 else None, completed=compiled_kernels() - before)
            time.sleep(POLL_S)

    def _stop(self) -> None:
        self._compiling.clear()
        self._bar.stop()


def show_summary(summary: dict[str, Any], out: Path) -> None:
    """Print what a run measured: a row a rank, then totals, latency and drops."""
    table = Table(title=f"{summary['seconds']:.1f} s, ended: {summary['ended']}", title_justify="left")
    for name in ("rank", "role", "region", "samples/s", "bytes/s", "peak memory"):
        table.add_column(name, justify="left" if name in ("role", "region") else "right")
    for rank in summary["ranks"]:
        rates = (si(rank["samples_per_s"]), si(rank["bytes_per_s"]), f"{rank['peak_memory'] / 2**20:.0f} MB")
        table.add_row(str(rank["rank"]), rank["role"], rank["region"], *rates)
    console.print(table)
    p50, p95, p99 = (summary["latency_ms"][name] for name in ("p50", "p95", "p99"))
    console.print(
        f"traced {si(summary['samples_traced'])} samples, shown {si(summary['samples_shown'])}; "
        f"{si(summary['packets'])} packets, {si(summary['bytes'])}B; "
        + (f"change to picture {p50:.1f} ms median, {p95:.1f} p95, {p99:.1f} p99" if p99 else "no change was timed")
    )
    if summary["dropped"]:
        console.print("dropped: " + ", ".join(f"{name} {count}" for name, count in summary["dropped"].items()))
    console.print(f"results in {out}/{_without_images(out, summary['seconds'])}, logs of all ranks in {out}/log/")


def _without_images(out: Path, seconds: float) -> str:
    """A remark, if a run of so many seconds that just ended left no images in its folder."""
    images = [out / "wall.png", *out.glob("panel-*.png")]
    written = [path.stat().st_mtime for path in images if path.exists()]
    if any(at > time.time() - seconds for at in written):
        return ""
    return " (its images are of an older run: no sink of this one writes files)" if written else " (no images)"
