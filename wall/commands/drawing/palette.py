"""Colours of processes that colour-blind readers can tell apart, also in grey: tints of Okabe and Ito (2008)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wall.commands.drawing.model import Process


@dataclass(frozen=True, slots=True, kw_only=True)
class Colours:
    """A process's colours: its area, and the lines and text in it."""

    fill: str
    line: str


RENDERER = Colours(fill="#f0f0f0", line="#767676")
HEAD = Colours(fill="#dceaf6", line="#0072b2")
COMPOSITORS = (
    Colours(fill="#fbead0", line="#a86b00"),
    Colours(fill="#d8efe6", line="#00805c"),
    Colours(fill="#f4e1ec", line="#a85586"),
    Colours(fill="#fbf7d3", line="#857c00"),
    Colours(fill="#f9e0d2", line="#b54e00"),
    Colours(fill="#dff1fb", line="#2b86bb"),
)
LIT, BEZEL, OVERLAP = "#ffffff", "#8c8c8c", "#d55e00"
FRUSTUM = "#0072b2"


def process_colours(processes: Mapping[str, Process]) -> dict[str, Colours]:
    """The colours of every process: renderers grey, the head blue, compositors one after another."""
    found, compositors = {}, 0
    for key, process in processes.items():
        if process.role == "compositor":
            found[key] = COMPOSITORS[compositors % len(COMPOSITORS)]
            compositors += 1
        else:
            found[key] = HEAD if process.role == "head" else RENDERER
    return found
