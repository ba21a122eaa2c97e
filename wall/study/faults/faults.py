"""`wall measure faults`: a wall for each fault, which is watched before it, during it and after it."""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import RenderableType

from wall.config.loading import Loaded, load
from wall.core.errors import ConfigError
from wall.display.image_log import LoggedImages, LoggedPanel, read_log
from wall.display.viewer import Seen
from wall.roles.plan import HEAD, Layout, make_layout, window_panels
from wall.roles.stale import Place, stale_places
from wall.study import json_lines
from wall.study.faults.hosts import Hosts
from wall.study.faults.intrusion import CONNECTIONS_A_S, slowed_by_stranger
from wall.study.faults.replacement import replace_head
from wall.study.faults.walls import FaultyWall, Slowed
from wall.study.live.rewriting import text_in_motion
from wall.study.live.runs import IMAGES, Bystanders
from wall.study.quality.tables import MET, MISSED, Table
from wall.study.speed import record

FILE = "faults.jsonl"
OWN = Path(__file__).parents[3] / "configs" / "two_compositors.yaml"
KILLED, FROZEN, SLOWED, FULL, REPLACED = "killed", "frozen", "slowed", "full disk", "replaced"
CUT, SLOW_LINK, LOSSY_LINK = "cut", "slow link", "lossy link"  # of a host
STRANGER, KEPT_OUT = "stranger", "stranger kept out"  # on the hosts' network, by transport.allow
SETTLE_S = 3.0  # that a wall runs before it is looked at
FROZEN_S = 1.5  # that a process stands still
CUT_S = 8.0  # that a host is cut off: longer than a rank may be silent, and than ZeroMQ keeps a connection
SLOW_BITS_S = 1_000_000
LOSS, DELAY_S = 0.02, 0.02  # of packets on a lossy link, each way
PORTS = "9000-9100"
TURNS_A_SECOND, MOST_TURNS = 2.5, 20  # of a stranger, for each second that other faults are watched
EVERYWHERE: Place = (0, 0, 1 << 20, 1 << 20)  # pixels
MOST_MARKED_MS = {KILLED: 100.0, FROZEN: 400.0, CUT: 400.0}  # what is wanted, as all of the following
MOST_LOST, LOST_S = 10.0, 1.0  # percent of the others' samples that may be lost after so long
MOST_AGAIN_MS, MOST_REPLACED_MS = 3000.0, 5000.0
MOST_SLOWED = 5.0  # percent that a stranger may take from all
MOST_LACKING = 0.9  # of its connections, below which it was none
MOVED_S, WHOLE = 0.5, 0.8  # of the pixels that changed so shortly before the fault: over others nothing moves any more
DISK = "1m"  # a folder of results that is soon full
NOTE = (
    f"Noticed and marked: on the page, after the fault; wanted: {MOST_MARKED_MS[KILLED]:g} ms where a process was "
    f"killed, {MOST_MARKED_MS[FROZEN]:g} ms where it was frozen or its host cut off. Whole image: {WHOLE:.0%} of the "
    f"pixels that moved in the {MOVED_S:g} s before have changed since the process died, or went on; wanted: "
    f"{MOST_AGAIN_MS:g} ms. Head replaced: until the next one's page answers, and shows that; wanted: "
    f"{MOST_REPLACED_MS:g} ms. Others: samples that the other renderers lost, from {LOST_S:g} s after the fault on; "
    f"wanted: {MOST_LOST:g} %. "
    f"Stranger: processor time that all renderers lack while it connects {CONNECTIONS_A_S:g} times a second; wanted: "
    f"{MOST_SLOWED:g} %. "
    "Left: processes 3 s after the end; wanted: none."
)
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """What is done to whom; `rank`: None: to the disk, or to all."""

    kind: str
    role: str
    rank: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What a fault did: a line of the file, keys in this order. None: it cannot be said, or was not to happen."""

    config: str
    fault: str
    role: str
    detected_ms: float | None  # until the page's table says that the rank is not heard of
    marked_ms: float | None  # until its part of the wall is marked
    whole_image_again_ms: float | None  # from its death or the fault's end until what it shows has been made anew
    others_lost_percent: float | None  # of the other renderers' samples, from LOST_S after the fault on
    left_behind: int  # processes, 3 s after the end
    ok: bool
    why: str  # not ok
    other_cores: float  # that everything else on the machine used during the run
    commit: str
    machine: str
    command: str


def faults_of(layout: Layout, hosts: int = 0) -> list[Fault]:
    """The faults that a wall can have whose ranks are forked, or started by mpirun on so many `hosts`."""
    ranks = {"renderer": layout.size - 1, "compositor": layout.graph.compositors - 1}
    there = {role: rank for role, rank in ranks.items() if rank != HEAD}
    kinds = [
        Fault(kind=kind, role=role, rank=rank) for role, rank in there.items() for kind in (KILLED, FROZEN, SLOWED)
    ]
    heads = [Fault(kind=kind, role="head", rank=HEAD) for kind in (FROZEN, SLOWED, KILLED, REPLACED)]
    if not hosts:
        return [*kinds, *heads, Fault(kind=FULL, role="", rank=None)]
    network = [Fault(kind=kind, role="host", rank=layout.size - 1) for kind in (CUT, SLOW_LINK, LOSSY_LINK)]
    strangers = [Fault(kind=kind, role="", rank=None) for kind in (STRANGER, KEPT_OUT)]
    return [*kinds, *(network if hosts > 1 else []), *strangers, *heads]


def measure(config: Path, *, seconds: float, hosts: int = 0, out: Path, say: Say) -> list[Row]:
    """Run a wall for each fault; `hosts`: see faults_of. Raises RunError, ConfigError."""
    loaded = load(config)
    if hosts:
        loaded = _with_transport(loaded, {"bind": "0.0.0.0", "ports": PORTS})
    layout = make_layout(loaded)
    if window_panels(layout, range(layout.size)) or not any(sink.kind == "browser" for sink in layout.graph.sinks):
        raise ConfigError(f"{config}: has windows, or no page; wanted a wall whose page tells of all of it")
    rows = []
    for fault in faults_of(layout, hosts):
        say(f"measuring {config.stem}: {fault.role} {fault.kind}")
        folder = out / "-".join(filter(None, [config.stem, fault.role, *fault.kind.split()]))
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        with contextlib.ExitStack() as closing:
            results = folder / "results"
            results.mkdir()
            if fault.kind == FULL and not mounted(results, closing):
                say("full disk: skipped; a small disk needs the rights of root")
                continue
            others = Bystanders()
            path = folder / config.name
            made = Hosts(hosts, folder / "hosts") if hosts else None
            if made is not None:
                closing.callback(made.close)
            own: dict[str, Any] = {"standby": True} if fault.kind == REPLACED else {}
            if fault.kind == KEPT_OUT and made is not None:
                own = {"allow": tuple(f"{address}/32" for address in made.addresses)}
            path.write_text(text_in_motion(_with_transport(loaded, own)), encoding="utf-8")
            keeps_images = fault.kind not in (REPLACED, STRANGER, KEPT_OUT)  # which another head could not go on with
            wall = FaultyWall(path, folder, results, keeps_images=keeps_images, hosts=made, ranks=layout.size)
            closing.callback(wall.close)
            measured = {REPLACED: _replaced, STRANGER: _slowed, KEPT_OUT: _slowed}.get(fault.kind, _measured)
            rows.append(measured(config, layout, fault, wall, others, seconds=seconds, results=results))
        shutil.rmtree(folder / IMAGES, ignore_errors=True)
        json_lines.append(out / FILE, rows[-1])
    return rows


def mounted(folder: Path, closing: contextlib.ExitStack) -> bool:
    """Put a small disk in a folder's place, until `closing`. Returns whether that can be done."""
    if os.geteuid() != 0 or shutil.which("mount") is None:
        return False
    command = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "none", str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        return False
    closing.callback(subprocess.run, ["umount", "--lazy", str(folder)], check=False)
    return True


def _measured(
    config: Path, layout: Layout, fault: Fault, wall: FaultyWall, others: Bystanders, *, seconds: float, results: Path
) -> Row:
    time.sleep(SETTLE_S + seconds)
    began = time.monotonic()
    dies = fault.role == "head" and fault.kind == KILLED
    ended = _do(fault, wall, seconds=seconds, results=results)  # the head is killed at the end
    if not dies:
        time.sleep(seconds)
    until, seen, dead = time.monotonic(), wall.seen, wall.process.poll() is not None
    code, left = wall.end(signal.SIGKILL if dies else signal.SIGINT)
    again = lost = None
    of_rank: Sequence[Place] = () if fault.rank is None else stale_places(layout, [fault.rank])
    if fault.role == "head":
        of_rank = [EVERYWHERE]
    if not dies:
        lost = others_lost(layout, seen, fault.rank, began=began, until=until, seconds=seconds)
    if not dies and fault.kind != FULL:
        again = whole_again(read_log(wall.images), of_rank, began=wall.clock(began), ended=wall.clock(ended))
    after = [each for each in seen if each.time >= began]
    told = of_rank if fault.role != "head" else ()  # by the head itself
    detected = _first(after, began, lambda status: not status["ranks"][fault.rank]["alive"]) if told else None
    marked = _first(after, began, lambda status: _marks(status, told)) if told else None
    if dead:
        why = f"the wall ended: {wall.said.strip()[-300:]}"
    elif dies:
        why = "" if (results / "summary.json").exists() else "no results were written"
    else:
        why = _why_not_ok(fault, detected, marked, again, lost)
    if fault.kind == FULL and not why:
        why = (
            "" if code == 1 and "No space left" in " ".join(wall.said.split()) else "nothing said that the disk is full"
        )
    return _row(config, fault, others, (detected, marked, again, lost), left=left, why=why)


def _replaced(
    config: Path, layout: Layout, fault: Fault, wall: FaultyWall, others: Bystanders, *, seconds: float, results: Path
) -> Row:
    time.sleep(SETTLE_S + seconds)
    answers, again = replace_head(results, wall.address, moved_s=MOVED_S, whole=WHOLE)
    time.sleep(seconds)
    code, left = wall.end(signal.SIGINT)
    found = [
        f"no {what}" if ms is None else f"{what} after {ms} ms"
        for what, ms in (("page", answers), ("whole image", again))
        if ms is None or ms > MOST_REPLACED_MS
    ]
    found += [] if code == 0 else [f"the wall ended with {code}: {wall.said.strip()[-300:]}"]
    return _row(config, fault, others, (answers, None, again, None), left=left, why="; ".join(found))


def _slowed(
    config: Path, layout: Layout, fault: Fault, wall: FaultyWall, others: Bystanders, *, seconds: float, results: Path
) -> Row:
    time.sleep(SETTLE_S)
    turns = min(MOST_TURNS, round(seconds * TURNS_A_SECOND))
    lost, a_second = slowed_by_stranger(wall, layout, PORTS, turns=turns)
    code, left = wall.end(signal.SIGINT)
    found = [f"renderers lost {lost} %"] if lost > MOST_SLOWED else []
    found += [f"only {a_second:.0f} connections a second"] if a_second < MOST_LACKING * CONNECTIONS_A_S else []
    found += [] if code == 0 else [f"the wall ended with {code}: {wall.said.strip()[-300:]}"]
    return _row(config, fault, others, (None, None, None, lost), left=left, why="; ".join(found))


def _row(
    config: Path, fault: Fault, others: Bystanders, found: tuple[float | None, ...], *, left: int, why: str
) -> Row:
    """`found`: what is noticed, marked, whole again, ms, and lost by others, percent."""
    detected, marked, again, lost = found
    why = "; ".join(filter(None, [why, f"{left} processes were left" if left else ""]))
    return Row(
        config=config.stem, fault=fault.kind, role=fault.role, detected_ms=detected, marked_ms=marked,
        whole_image_again_ms=again, others_lost_percent=lost, left_behind=left, ok=not why, why=why,
        other_cores=round(others.cores(), 2),
        commit=record.commit(), machine=record.machine(), command=record.command(),
    )  # fmt: skip


def _with_transport(loaded: Loaded, changes: dict[str, Any]) -> Loaded:
    transport = loaded.config.transport.model_copy(update=changes)
    return loaded.with_config(loaded.config.model_copy(update={"transport": transport}))


def _do(fault: Fault, wall: FaultyWall, *, seconds: float, results: Path) -> float:
    """Let it happen. Returns when the process could go on: at once where it was killed."""
    began = time.monotonic()
    if fault.rank is None:
        _fill(results)
    elif fault.kind == KILLED and fault.rank != HEAD:
        os.kill(wall.process_of(fault.rank), signal.SIGKILL)
    elif fault.kind == FROZEN:
        pid = wall.process_of(fault.rank)
        os.kill(pid, signal.SIGSTOP)
        time.sleep(FROZEN_S)
        os.kill(pid, signal.SIGCONT)
        return time.monotonic()
    elif fault.kind == SLOWED:
        with Slowed(wall.process_of(fault.rank)):
            time.sleep(seconds)
        return time.monotonic()
    elif fault.kind in (CUT, SLOW_LINK, LOSSY_LINK):
        assert wall.hosts is not None
        host = wall.hosts.of(fault.rank)
        if fault.kind == CUT:
            wall.hosts.cut(host)
            time.sleep(CUT_S)
            wall.hosts.join(host)
        elif fault.kind == SLOW_LINK:
            wall.hosts.slow(host, SLOW_BITS_S)
            time.sleep(seconds)
            wall.hosts.speed_up(host)
        else:
            wall.hosts.degrade(host, loss=LOSS, delay_s=DELAY_S)
            time.sleep(seconds)
            wall.hosts.repair(host)
        return time.monotonic()
    return began


def _marks(status: dict[str, Any], places: Sequence[Place]) -> bool:
    """Whether the page marks one of these."""
    return any(tuple(place) in places for place in status["stale"])


def _fill(folder: Path) -> None:
    with contextlib.suppress(OSError), (folder / "everything").open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def _first(seen: Sequence[Seen], began: float, holds: Callable[[dict[str, Any]], bool]) -> float | None:
    """Milliseconds until the page was told what holds; None: it was not."""
    return next((round(1e3 * (each.time - began), 1) for each in seen if holds(each.status)), None)


def others_lost(
    layout: Layout, seen: Sequence[Seen], rank: int | None, *, began: float, until: float, seconds: float
) -> float | None:
    """Percent of the samples a second of others that are missing after a fault; None: there are no others.

    Others are renderers but `rank`, and but those that send it samples.
    """
    fed = {sender for layer in layout.graph.layers if layer.compositor == rank for sender in layer.ranks}
    others = [other for other in layout.renderers() if other != rank and other not in fed]
    rates = [(each.time, sum(each.status["ranks"][other]["samples_per_s"] for other in others)) for each in seen]
    before = [rate for moment, rate in rates if began - seconds <= moment < began]
    after = [rate for moment, rate in rates if began + LOST_S <= moment < until]
    if not others or not before or not after or not np.mean(before):
        return None
    return round(100.0 * max(0.0, 1.0 - float(np.mean(after)) / float(np.mean(before))), 1)


def whole_again(log: LoggedImages, places: Sequence[Place], *, began: float, ended: float) -> float | None:
    """Milliseconds until WHOLE of the pixels at `places` that moved have changed after `ended`; None: they have not."""
    times = [_panel_again(log, name, places, began=began, ended=ended) for name in _panels(log)]
    known = [moment for moment in times if moment is not None]
    return None if not known or max(known) == np.inf else round(max(known), 1)


def _panels(log: LoggedImages) -> list[str]:
    return list(dict.fromkeys(panel.panel for panel in log.panels))


def _panel_again(log: LoggedImages, name: str, places: Sequence[Place], *, began: float, ended: float) -> float | None:
    """None where nothing of a panel is at `places`, or moved; infinite where it does not move again."""
    images = [panel for panel in log.panels if panel.panel == name]
    inside = _mask(images[0], places)
    moved = np.zeros_like(inside)
    for one, other in itertools.pairwise(panel for panel in images if began - MOVED_S <= panel.time < began):
        moved |= inside & (log.rgb(one) != log.rgb(other)).any(axis=-1)
    if not moved.any():
        return None
    changed = np.zeros_like(inside)
    for one, other in itertools.pairwise(images):
        if other.time >= ended:
            changed |= (log.rgb(one) != log.rgb(other)).any(axis=-1)
            if changed[moved].mean() >= WHOLE:
                return 1e3 * (other.time - ended)
    return float(np.inf)


def _mask(panel: LoggedPanel, places: Sequence[Place]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """(h, w) bool: pixels of a panel at places."""
    (left, top), (width, height) = panel.screen, panel.size
    mask = np.zeros((height, width), np.bool_)
    for x, y, w, h in places:
        mask[
            max(0, round(y - top)) : max(0, round(y + h - top)), max(0, round(x - left)) : max(0, round(x + w - left))
        ] = 1
    return mask


def _why_not_ok(
    fault: Fault, detected: float | None, marked: float | None, again: float | None, lost: float | None
) -> str:
    """What is not as wanted, in words; "" for nothing."""
    found = []
    if fault.role != "head" and (most := MOST_MARKED_MS.get(fault.kind)) is not None:
        for word, value in (("noticed", detected), ("marked", marked)):
            if value is None or value > most:
                found.append(f"{word} after {value} ms" if value is not None else f"not {word}")
    if fault.kind != FULL and (again is None or again > MOST_AGAIN_MS):
        found.append("no whole image" if again is None else f"whole image after {again} ms")
    if lost is not None and lost > MOST_LOST:
        found.append(f"others lost {lost} %")
    return "; ".join(found)


def report(rows: Sequence[Row], out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    columns = (
        "wall", "fault", "noticed, ms", "marked, ms", "whole image, ms", "others lost, %", "left", "met", "why not",
        "other cores",
    )  # fmt: skip
    lines = tuple(
        (
            row.config, f"{row.role} {row.fault}".strip(), *map(_number, (row.detected_ms, row.marked_ms)),
            _number(row.whole_image_again_ms), _number(row.others_lost_percent), str(row.left_behind),
            MET if row.ok else MISSED, row.why, f"{row.other_cores:.1f}",
        )
        for row in rows
    )  # fmt: skip
    yield Table(title="Faults", columns=columns, lines=lines, text=(0, 1, 7, 8), note=NOTE).rich()
    yield f"rows in {out / FILE}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.0f}"
