"""Colours that stay apart for colour-blind readers, and in grey: tints of Okabe and Ito's set (2008), by process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wall.commands.drawing.model import Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Tint:
    """Of a process: its area, and the lines in it."""

    fill: str
    line: str


RENDERER = Tint(fill="#f0f0f0", line="#767676")
HEAD = Tint(fill="#dceaf6", line="#0072b2")
COMPOSITORS = (
    Tint(fill="#fbead0", line="#a86b00"),
    Tint(fill="#d8efe6", line="#00805c"),
    Tint(fill="#f4e1ec", line="#a85586"),
    Tint(fill="#fbf7d3", line="#857c00"),
    Tint(fill="#f9e0d2", line="#b54e00"),
    Tint(fill="#dff1fb", line="#2b86bb"),
)
LIT, BEZEL, OVERLAP = "#ffffff", "#8c8c8c", "#d55e00"
FRUSTUM = "#0072b2"


def tints(places: Mapping[str, Place]) -> dict[str, Tint]:
    """The tint of every place: renderers grey, the head blue, compositors in turn."""
    found, compositors = {}, 0
    for key, place in places.items():
        if place.role == "compositor":
            found[key] = COMPOSITORS[compositors % len(COMPOSITORS)]
            compositors += 1
        else:
            found[key] = HEAD if place.role == "head" else RENDERER
    return found
