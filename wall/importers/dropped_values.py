"""Drop the values of a conversion that a configuration refuses, and list each with its line in the source.

Converters clamp the limits that they know; this handles everything else that the loader and the wall's checks refuse.
"""

from __future__ import annotations

import re
from typing import Any

from wall.config import yaml_text
from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.importers.panels import enough_ranks
from wall.importers.report import Conversion, Item
from wall.roles.plan import Layout, make_layout

ROUNDS = 6  # the loader tells all values at once, then come checks of the wall, then of the graph
NAME = "YAML"
OPTIONAL = (
    "bezel", "overlap", "rotation", "eye", "stereo", "colour", "blend", "blend_mask", "warp", "host", "display",
    "monitor", "window", "refresh_hz", "eye_separation", "scale", "range",
)  # fmt: skip

_PROBLEM = re.compile(rf"{NAME}:\d+:\d+: ([\w.\[\]]+)(?:: | = )(.*)")
_WRONG_RANKS = re.compile(r"panel .*: (?:with ranks: \d+ a region is larger than \d+|\d+ ranks are too many)")
_STEP = re.compile(r"\w+")

Path = tuple[str | int, ...]


def checked_layout(conversion: Conversion) -> Layout:
    """Check a conversion's values, drop what is refused, and return the layout of the rest.

    Changes `conversion`: drops a refused optional key, a refused panel if there are others, and replaces a refused
    graph by one image a panel. Raises ConfigError if too little is left.
    """
    for _ in range(ROUNDS):
        try:
            return make_layout(loads(yaml_text.write(conversion.values), name=NAME))
        except ConfigError as error:
            dropped = [_drop_value(conversion, path, why) for path, why in _problems(str(error))]
            if not any(dropped):
                raise
            _remove_dropped_panels(conversion)
    return make_layout(loads(yaml_text.write(conversion.values), name=NAME))


def _problems(text: str) -> list[tuple[Path, str]]:
    """The paths that an error names, each once, with the error's text about them."""
    found: dict[Path, str] = {}
    for line in text.splitlines():
        if (match := _PROBLEM.match(line)) is not None:
            steps = tuple(int(step) if step.isdigit() else step for step in _STEP.findall(match[1]))
            found.setdefault(steps, f"{match[1].split('.')[-1]} {match[2]}")
    if not found and (match := _WRONG_RANKS.search(text)) is not None:
        found["graph",] = match[0]
    return list(found.items())


def _drop_value(conversion: Conversion, path: Path, why: str) -> bool:
    """Drop the value at a path, or the value that contains it. Returns False if the wall needs it."""
    values: Any = conversion.values
    for step in path:
        if isinstance(values, dict) and step in OPTIONAL:
            if values.pop(step, None) is not None:
                _list(conversion, path, f"{why}; its {step} is left out")
            return True
        if not _has(values, step):
            break
        values = values[step]
    if path[:1] == ("graph",):
        return _plain_graph(conversion, path, why)
    if path[:2] == ("wall", "panels") and len(path) > 2 and len(conversion.values["wall"]["panels"]) > 1:
        panel = conversion.values["wall"]["panels"][path[2]]
        if panel is not None:
            _list(conversion, path, f"{why}; the panel is left out")
            conversion.values["wall"]["panels"][path[2]] = None  # removed later: other problems' indices count it
        return True
    return False


def _plain_graph(conversion: Conversion, path: Path, why: str) -> bool:
    """Replace the graph by one with ranks of its own for each panel. Returns False if it is that already."""
    plain = enough_ranks(conversion.values["wall"]["panels"])
    if conversion.values.get("graph") == plain.get("graph"):
        return False
    conversion.values.pop("graph", None)
    conversion.values |= plain
    _list(conversion, path, f"{why}; each panel has ranks of its own instead, and nothing is composited")
    return True


def _has(values: Any, step: str | int) -> bool:
    """Whether a dict or list has an entry at this step of a path."""
    if isinstance(values, dict):
        return step in values
    return isinstance(values, list) and isinstance(step, int) and step < len(values)


def _remove_dropped_panels(conversion: Conversion) -> None:
    """Remove dropped panels from the values, and the graph whose nodes may name them."""
    wall = conversion.values["wall"]
    kept = [k for k, panel in enumerate(wall["panels"]) if panel is not None]
    if len(kept) == len(wall["panels"]):
        return
    wall["panels"] = [wall["panels"][k] for k in kept]
    conversion.origins = [conversion.origins[k] for k in kept if k < len(conversion.origins)]
    conversion.panels = len(kept)
    conversion.values.pop("graph", None)
    conversion.values |= enough_ranks(wall["panels"])


def _list(conversion: Conversion, path: Path, why: str) -> None:
    """List a path as not carried, with the line of its panel, else of an item that carried its key, else line 1."""
    number = path[2] if path[:2] == ("wall", "panels") and len(path) > 2 else None
    if isinstance(number, int) and number < len(conversion.origins):
        origin = conversion.origins[number]
    else:
        words = [step for step in path if isinstance(step, str)]
        carried = (item for item in conversion.carried if words and words[-1] in item.why + item.what)
        origin = next(carried, Item(what="the file", line=1))
    item = Item(what=origin.what, line=origin.line, why=why)
    conversion.not_carried = sorted([*conversion.not_carried, item], key=lambda item: item.line)
