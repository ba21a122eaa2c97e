"""The texts' walls as plans of 1,000 ranks: a display machine for each panel, all other ranks render.

The texts name pixels, dpi and rates (see target.py); how many panels, and how ranks are dealt, is chosen here. Every
panel has a compositor on its own machine and the same number of renderers, each on a core of its own; the first one's
machine has the manager too.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wall.config.loading import Loaded, loads
from wall.study.plan.target import INCH_M, TEXTS, Target

PERIOD_S = 40.0  # of the camera's orbit


@dataclass(frozen=True, slots=True, kw_only=True)
class Dealt:
    """How a wall's ranks are dealt."""

    target: Target
    columns: int
    rows: int
    pixels: tuple[int, int]  # of a panel
    ranks_per_panel: int
    batch: int  # samples; large ones for few events, since a simulated packet costs as much time as a large one


THOUSAND = (
    Dealt(target=TEXTS[0], columns=10, rows=5, pixels=(3840, 2370), ranks_per_panel=19, batch=8192),
    Dealt(target=TEXTS[1], columns=10, rows=10, pixels=(3440, 1948), ranks_per_panel=9, batch=8192),
    Dealt(target=TEXTS[2], columns=25, rows=20, pixels=(3840, 3750), ranks_per_panel=1, batch=8192),
)


def config_of(dealt: Dealt) -> Loaded:
    """The configuration of a wall, its windows shown by the compositors of their panels."""
    pitch = INCH_M / dealt.target.dpi
    width, height = (edge * pitch for edge in dealt.pixels)
    text = f"""version: 1
scene: {{source: courtyard}}
wall:
  grid:
    columns: {dealt.columns}
    rows: {dealt.rows}
    pixels: [{dealt.pixels[0]}, {dealt.pixels[1]}]
    size: [{width:.6f}, {height:.6f}]
    host: "display{{column}}-{{row}}"
views:
  - camera: {{position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}}
    path: {{type: orbit, period_s: {PERIOD_S:g}}}
    refresh_hz: {dealt.target.refresh_hz:g}
sampling: {{method: adaptive, samples_per_batch: {dealt.batch}}}
graph:
  preset: sort-first
  compositors: {dealt.columns * dealt.rows}
  ranks_per_panel: {dealt.ranks_per_panel}
  sinks: [window]
"""
    return loads(text, name=dealt.target.name, path=Path(f"{dealt.target.name}.yaml"))
