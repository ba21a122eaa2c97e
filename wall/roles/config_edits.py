"""Changes of a running wall's configuration, for what no parameter changes: objects, views, panels.

    scene.source+=bunny.glb                    adds to a list (of one entry, or none, a list is made)
    views-=map                                 removes from a list: what equals the value, or has it as its id
    wall.panels.r0c0.warp={file: left.obj}     sets a value; null removes it

A path is keys with dots between them; entries of lists go by number or id. Values are YAML.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any, TypeAlias

from wall.config import yaml_text
from wall.config.schema import Config
from wall.core.errors import EditError
from wall.geometry.expanding import expanded_config

Step: TypeAlias = str | int
PANELS, GRID = ["wall", "panels"], ["wall", "grid"]
NO_GRID = (
    "this wall has no grid: its panels are written one by one, as an edit of one of them does; wanted: that undone, "
    "changes of wall.panels, or a whole wall.grid={...} with wall.panels=null"
)
KINDS = ("method", "op", "type")  # keys whose value decides which other keys there may be
MOST_NAMED = 8  # entries that a refusal names

_CHANGE = re.compile(r"([^=]*?)(\+=|-=|=)(.*)", re.DOTALL)


def text_of(config: Config) -> str:
    """The whole configuration as JSON, which is YAML too and takes a hundredth of the time to write."""
    return _json(config.model_dump(mode="json", exclude_none=True))


def edited(config: Config, changes: Sequence[Any]) -> str:
    """The whole configuration after these changes, as JSON. Raises EditError; it is not checked beyond that.

    A grid's panels are written one by one where a change names one. What becomes of another kind keeps the keys that
    were written, and not those that it had by default.
    """
    parsed = [_parsed(change) for change in changes]
    if config.wall.grid is not None and any(path[:2] == PANELS for path, _, _ in parsed):
        config = config.model_copy(update={"wall": expanded_config(config.wall)})
    values = config.model_dump(mode="json", exclude_none=True)
    written = config.model_dump(mode="json", exclude_none=True, exclude_unset=True, exclude_defaults=True)
    changed: list[list[str]] = []
    for (path, how, value), change in zip(parsed, changes, strict=True):
        try:
            if path[:-1] == GRID and not values["wall"].get("grid"):
                raise EditError(NO_GRID)
            parent = _at(values, path[:-1])
            if how == "=" and path[-1] in KINDS and isinstance(parent, dict):
                kept = {each[-1] for each in changed if each[:-1] == path[:-1]}
                kept.update(_written(written, values, path[:-1]))
                for key in [key for key in parent if key not in kept]:
                    del parent[key]
            changed.append(path)
            _CHANGERS[how](parent, _key(parent, path[-1], new=how != "-="), value)
        except EditError as error:
            raise EditError(f"{change}: {error}") from None
    return _json(values)


def _json(values: Any) -> str:
    return json.dumps(values, ensure_ascii=False)


def _parsed(change: Any) -> tuple[list[str], str, Any]:
    """Path, operator and value of a change."""
    if not isinstance(change, str):
        raise EditError(f"{str(change)[:60]}: is no text; wanted: PATH=VALUE, PATH+=VALUE or PATH-=VALUE")
    found = _CHANGE.fullmatch(change)
    path = re.findall(r"[^.\[\]\s]+", found[1]) if found is not None else []
    if found is None or not path:
        raise EditError(f"{change}: is no change; wanted: PATH=VALUE, PATH+=VALUE or PATH-=VALUE")
    value = yaml_text.parse(found[3])
    if value.problems:
        raise EditError(f"{change}: {value.problems[0].what}; wanted: a value as in YAML")
    return path, found[2], value.values


def _at(values: Any, path: Sequence[str]) -> Any:
    """What stands at a path, which is made of mappings where nothing does."""
    for step in path:
        key = _key(values, step, new=True)
        if isinstance(values, dict):
            values.setdefault(key, {})
        values = values[key]
    return values


def _written(written: Any, values: Any, path: Sequence[str]) -> Any:
    """What was written at a path, which goes by the names that `values` has; nothing where nothing was."""
    for step in path:
        key = _key(values, step, new=False)
        try:
            values, written = values[key], written[key]
        except (KeyError, IndexError, TypeError):
            return {}
    return written


def _key(values: Any, step: str, *, new: bool) -> Step:
    """The key of a mapping, or the index in a list. `new`: a mapping need not have it."""
    if isinstance(values, dict):
        if new or step in values:
            return step
        raise EditError(f"there is no {step}; there are: {_some(list(values))}")
    if not isinstance(values, list):
        raise EditError(f"{values!r} is no list or mapping, so nothing is in it")
    names = _names(values)
    if step in names:
        return names.index(step)
    if step.isdecimal() and int(step) < len(values):
        return int(step)
    raise EditError(f"there is no {step}; there are: {_some(names)}")


def _set(parent: Any, key: Any, value: Any) -> None:
    if value is not None:
        parent[key] = value
    elif isinstance(parent, list) or key in parent:
        del parent[key]


def _add(parent: Any, key: Step, value: Any) -> None:
    before = parent.get(key, []) if isinstance(parent, dict) else parent[int(key)]
    parent[key] = [*(before if isinstance(before, list) else [before]), value]


def _remove(parent: Any, key: Step, value: Any) -> None:
    before = parent[key] if isinstance(parent[key], list) else [parent[key]]
    kept = [each for each, name in zip(before, _names(before), strict=True) if each != value and name != str(value)]
    if len(kept) == len(before):
        raise EditError(f"{value} is not in it; there are: {_some(_names(before))}")
    parent[key] = kept


_CHANGERS = {"=": _set, "+=": _add, "-=": _remove}


def _names(values: list[Any]) -> list[str]:
    """What entries of a list are called: by their id, else as they stand, or by their number."""
    return [
        (str(each["id"]) if "id" in each else str(k)) if isinstance(each, dict) else str(each)
        for k, each in enumerate(values)
    ]


def _some(names: list[str]) -> str:
    return ", ".join(names[:MOST_NAMED]) + (f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else "")
