"""The configuration's JSON Schema, for editors and for what errors say is accepted."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from wall.config.schema import Config
from wall.core.fields import SRGB_PATTERN

FILE_NAME = "wall.schema.json"
BOUNDS = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "exclusiveMaximum": "below"}
KINDS = "kinds"  # in a resolved union: the values that its `type` or `op` may have


def schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the YAML, a fresh copy."""
    document = Config.model_json_schema(mode="validation")
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "wall configuration",
        "description": "A scene on a tiled display wall.",
    }
    for model in document["$defs"].values():
        if "op" in model["properties"]:  # an operator says in its docstring what it does
            model["properties"]["op"].setdefault("description", model.get("description", "").partition("\n")[0])
    return {**document, **head}


def schema_text() -> str:
    """The text of configs/wall.schema.json."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


@cache
def _shared() -> dict[str, Any]:
    return schema()


def at(path: tuple[str | int, ...], values: Any) -> dict[str, Any]:
    """The part of the schema that holds at a YAML path of the given values; {} where there is none."""
    node = _resolved(_shared(), values)
    for step in path:
        values = _child(values, step)
        node = _resolved(_step(node, step), values)
    return node


def keys_of(node: dict[str, Any]) -> list[str]:
    """The keys that a mapping may have."""
    return list(node.get("properties", {}))


def choices(node: dict[str, Any]) -> list[str]:
    """The words among which a value must be chosen; [] where any will do."""
    branches = [node, *node.get("anyOf", [])]
    return [str(word) for b in branches for word in ([b["const"]] if "const" in b else b.get("enum", []))]


def accepted(node: dict[str, Any]) -> str:
    """What a part of the schema accepts, in words."""
    words = _words(node)
    if words and (description := node.get("description")) and node.get("type") != "object":
        return f"{words} ({description})"
    return words


def _child(values: Any, step: str | int) -> Any:
    if isinstance(values, dict):
        return values.get(step)
    if isinstance(values, (list, tuple)) and isinstance(step, int) and step < len(values):
        return values[step]
    return None


def _step(node: dict[str, Any], step: str | int) -> dict[str, Any]:
    if isinstance(step, int):
        fixed = node.get("prefixItems", [])
        found = fixed[step] if step < len(fixed) else node.get("items", {})
    else:
        found = node.get("properties", {}).get(step, {})
    return found if isinstance(found, dict) else {}


def _resolved(node: dict[str, Any], values: Any) -> dict[str, Any]:
    """Follow $ref, choose the branch of a union that fits; the description nearest to the use stays."""
    own = node.get("description")
    while "$ref" in node:
        node = _shared()["$defs"][node["$ref"].rpartition("/")[2]]
    kinds = list(node.get("discriminator", {}).get("mapping", {}))
    branches = [b for b in node.get("anyOf", node.get("oneOf", [])) if b.get("type") != "null"]
    if branches:
        resolved = [_resolved(branch, values) for branch in branches]
        best = max(resolved, key=lambda branch: _fit(branch, values))
        several = _fit(best, values) <= 0
        node = {"anyOf": resolved} if several and len(resolved) > 1 else best
        node = {**node, KINDS: kinds} if kinds else node
    return {**node, "description": own or node["description"]} if own or "description" in node else node


def _fit(branch: dict[str, Any], values: Any) -> int:
    """How well a branch fits: kind of value first, then `type`, `op` or `method`, then known keys."""
    kinds: dict[str, Any] = {"object": dict, "array": (list, tuple), "string": str, "boolean": bool}
    kind = kinds.get(branch.get("type", ""), (int, float))
    choices = [branch["const"]] if "const" in branch else branch.get("enum")
    if not isinstance(values, kind) or (choices is not None and values not in choices):
        return 0
    if not isinstance(values, dict):
        return 1
    properties = branch.get("properties", {})
    score = 1 + sum(key in properties for key in values)
    for key in ("type", "op", "method"):
        constant = properties.get(key, {}).get("const")
        if constant is not None and key in values:
            score += 1000 if values[key] == constant else -1000
    return score


def _words(node: dict[str, Any]) -> str:
    if "const" in node:
        return json.dumps(node["const"]) if not isinstance(node["const"], str) else str(node["const"])
    if "enum" in node:
        return ", ".join(str(value) for value in node["enum"])
    if "anyOf" in node:
        return " or ".join(dict.fromkeys(filter(None, (_words(branch) for branch in node["anyOf"]))))
    kind = node.get("type", "")
    if kind in ("number", "integer"):
        return ("a whole number" if kind == "integer" else "a number") + _bounds(node)
    if kind == "array":
        return _list_words(node)
    if kind == "object":
        return f"a mapping with {', '.join(keys_of(node))}"
    if node.get("pattern") == SRGB_PATTERN:
        return "'#rrggbb' (sRGB, in quotes)"
    text = "letters, digits, '.', '_' and '-'" if "pattern" in node else "text"
    return {"string": text, "boolean": "true or false"}.get(kind, "")


def _list_words(node: dict[str, Any]) -> str:
    if fixed := node.get("prefixItems"):
        return f"[{', '.join(['number'] * len(fixed))}]: each {_words(_resolved(fixed[0], None))}"
    least = node.get("minItems", 0)
    return f"a list of {least} or more" if least else "a list"


def _bounds(node: dict[str, Any]) -> str:
    form = "d" if node.get("type") == "integer" else "g"
    return "".join(f" {word} {node[key]:{form}}" for key, word in BOUNDS.items() if key in node)
