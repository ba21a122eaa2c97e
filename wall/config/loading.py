"""Load YAML files into checked configurations. Errors say file:line:column, YAML path, value, what is accepted.

All errors of a file are reported at once, in the order of the file.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from wall.config import json_schema, yaml_text
from wall.config.materials import AmbientOcclusionConfig, DirectConfig, PathConfig
from wall.config.scene import SceneConfig, Up
from wall.config.schema import Config
from wall.config.views import MOST_STOPS, CameraConfig, OrbitPathConfig, ViewConfig
from wall.config.yaml_text import Document, YamlPath
from wall.core.errors import ConfigError
from wall.core.files import read_file
from wall.core.tone_mapping import TONE_MAPPINGS

VERSION = 1
TOP = f"version: {VERSION}, scene, wall, views"
INTEGRATORS: dict[str, type[DirectConfig | PathConfig | AmbientOcclusionConfig]] = {
    "direct": DirectConfig, "path": PathConfig, "ambient_occlusion": AmbientOcclusionConfig,
}  # fmt: skip
MOST_EXPLAINED = 50  # refused values that are told one by one
_ABSENT = object()


_NAMED = re.compile(r"(scene(?:\.\w+|\[\d+\])+)(?: = (?:'[^']*'|[\w.]+))?: (.*)", re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """A checked configuration that remembers where it came from."""

    config: Config
    path: Path  # of the file; its folder is where relative scene sources start
    name: str  # how errors call the file
    document: Document
    scene_named: str = ""  # what errors of the scene blame instead, where the file does not name it

    @property
    def folder(self) -> Path:
        """Folder of the configuration file, against which its relative paths resolve."""
        return self.path.parent

    def error(self, yaml_path: YamlPath, message: str, accepted: str = "") -> ConfigError:
        """A refusal that points into the file, for checks that need more than the file itself.

        A message that begins with a place in it, `scene.data[0].file = 'a.vtp': ...`, points there.
        """
        if (named := _NAMED.match(message)) is not None:
            yaml_path, message = _path_of(named[1]), named[2]
        if self.scene_named and yaml_path[:1] == ("scene",):
            said = message if message.startswith(f"{self.scene_named}: ") else f"{self.scene_named}: {message}"
            return ConfigError(said + (f"; accepted: {accepted}" if accepted else ""))
        return ConfigError(_line(self.name, self.document, yaml_path, message, accepted=accepted))

    def with_config(self, config: Config) -> Loaded:
        """The same file with other values (errors still point to where the old ones stood)."""
        return replace(self, config=config)


def load(path: str | Path) -> Loaded:
    """Read and check a configuration file. Raises ConfigError, and nothing else, whatever is wrong."""
    path = Path(path)
    return loads(read_text(path), name=str(path), path=path)


def read_text(path: str | Path) -> str:
    """The text of a configuration file, unchecked. Raises ConfigError where there is none."""
    path = Path(path)
    try:
        if path.is_dir():
            raise ConfigError(f"{path}: this is a folder; accepted: a YAML file")
        return read_file(path, yaml_text.MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: byte {error.start} is not UTF-8 text; accepted: a YAML file in UTF-8") from None
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file{_near_file(path)}") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def loads(text: str, *, name: str = "<text>", path: Path | None = None) -> Loaded:
    """Check a configuration given as text; `name` stands for the file in errors. Raises ConfigError only."""
    document = yaml_text.parse(text)
    lines = [
        (p.position, _line(name, document, p.path, p.what, accepted=p.accepted, position=p.position, key=True))
        for p in document.problems
    ]
    if document.values is None or (lines and not isinstance(document.values, dict)):
        raise _refusal(lines or [(None, f"{name}: the file is empty; accepted: version: 1, scene, wall, views")])
    if not isinstance(document.values, dict):
        raise ConfigError(f"{name}:1:1: this is not a mapping; accepted: {TOP}")
    if any(problem.path == ("version",) for problem in document.problems):
        raise _refusal(lines)
    return _checked(document, lines, name=name, path=path or Path(name))


def load_values(values: dict[str, Any], *, name: str, path: Path) -> Loaded:
    """Check a configuration given as plain values, as YAML has them; errors are those of files, without lines.

    name : what errors call it; path : a file in the folder where its relative paths start. Raises ConfigError only.
    """
    return _checked(Document(values=values), [], name=name, path=path)


def _checked(
    document: Document, lines: list[tuple[yaml_text.Position | None, str]], *, name: str, path: Path
) -> Loaded:
    """`lines`: what is refused already."""
    _check_version(name, document)
    try:
        config = Config.model_validate(document.values)
    except ValidationError as error:
        # a value that YAML refused already is null now: its second refusal would only confuse
        known = {problem.path for problem in document.problems}
        found = [(_yaml_path(document.values, each), each) for each in error.errors(include_url=False)]
        around = {path[:k] for path, _ in found for k in range(len(path))}
        around |= {path for path, each in found if not each["type"].endswith("_type")}
        errors = [
            each for path, each in found
            if path not in known and not _is_echo(_value_at(document.values, path), each, around=path in around)
        ]  # fmt: skip
        lines += [_explained(name, document, details) for details in errors[:MOST_EXPLAINED]]
        if len(errors) > MOST_EXPLAINED:
            raise ConfigError(f"{_refusal(lines)}\n{name}: and {len(errors) - MOST_EXPLAINED} more") from None
    if lines:
        raise _refusal(lines)
    return Loaded(config=config, path=path, name=name, document=document)


def dump(config: Config) -> str:
    """The whole configuration, defaults spelled out, as YAML that loads to an equal one."""
    return yaml_text.write(config.model_dump(mode="json", exclude_none=True))


def default_for_model(path: str | Path) -> Loaded:
    """The demo's wall (2 x 2 panels of 480 x 270) around a model of the user's: framed, lit and circled."""
    path = Path(path)
    values = {
        "version": VERSION,
        "scene": {"source": path.name or str(path)} | ({"ground": True} if path.suffix else {}),
        "wall": {"grid": {"columns": 2, "rows": 2, "pixels": [480, 270], "size": [0.48, 0.27], "bezel": 0.006}},
        "views": [{"id": "main", "camera": "auto", "path": {"type": "orbit", "period_s": 20.0}, "refresh_hz": 30.0}],
    }
    return replace(loads(yaml_text.write(values), name=str(path), path=path), scene_named=str(path))


def with_scene(loaded: Loaded, source: str | Path) -> Loaded:
    """The same wall around another model: its own lights and motion, framed and circled.

    Views that follow another's camera still do. Those that have a direction keep it, and so do, of several, those that
    stand: they look the way they did.
    """
    file = Path(source)  # beside the caller, not beside the configuration; built-in scenes have no suffix
    text = str(file.absolute()) if file.suffix or file.exists() else str(source)
    views = loaded.config.views
    views = tuple(_around_another_model(view, stands=view.path is None and len(views) > 1) for view in views)
    try:
        scene = SceneConfig(source=text, ground=bool(file.suffix))
    except ValidationError:
        raise ConfigError(f"{text!r} is not a scene; accepted: a name or a model file") from None
    loaded = replace(loaded, scene_named=f"--scene {source}")
    return loaded.with_config(loaded.config.model_copy(update={"scene": scene, "views": views}))


def _around_another_model(view: ViewConfig, *, stands: bool) -> ViewConfig:
    camera = view.camera
    if camera.follow is not None:
        return view
    if stands or camera.direction is not None:
        direction = camera.direction
        if camera.position is not None and camera.target is not None:
            (x, y, z), (to_x, to_y, to_z) = camera.position, camera.target
            away = math.dist(camera.position, camera.target)
            direction = ((to_x - x) / away, (to_y - y) / away, (to_z - z) / away)
        update: dict[str, Any] = {"camera": CameraConfig(direction=direction, up=camera.up, fov=camera.fov)}
    else:
        path = view.path if isinstance(view.path, OrbitPathConfig) else OrbitPathConfig(type="orbit")
        update = {"camera": CameraConfig(fov=camera.fov), "path": path}
    return view.model_copy(update=update)


def with_up(loaded: Loaded, up: str) -> Loaded:
    """The same wall, its models turned so that `up` is up in them. Raises ConfigError."""
    if up not in get_args(Up):
        raise ConfigError(f"--up {up}: is no direction; accepted: {', '.join(get_args(Up))}")
    scene = loaded.config.scene.model_copy(update={"up": up})
    return loaded.with_config(loaded.config.model_copy(update={"scene": scene}))


def with_integrator(loaded: Loaded, method: str) -> Loaded:
    """The same wall, light followed by one method in all of its views. Raises ConfigError.

    An integrator of that method that the configuration has keeps its other values.
    """
    if method not in INTEGRATORS:
        accepted = ", ".join(INTEGRATORS)
        raise ConfigError(f"--integrator {method}: is not known; accepted: {accepted}{nearest(method, INTEGRATORS)}")
    scene, views = loaded.config.scene, loaded.config.views
    own, plain = scene.integrator, INTEGRATORS[method].model_validate({"method": method})
    scene = scene.model_copy(update={"integrator": own if own is not None and own.method == method else plain})
    kept = [view.integrator is not None and view.integrator.method == method for view in views]
    others = (
        view if keeps else view.model_copy(update={"integrator": None}) for view, keeps in zip(views, kept, strict=True)
    )
    return loaded.with_config(loaded.config.model_copy(update={"scene": scene, "views": tuple(others)}))


def with_tone(loaded: Loaded, exposure: float | None, tone_mapping: str | None) -> Loaded:
    """The same wall, all of its views exposed and mapped so; None: as configured. Raises ConfigError."""
    if exposure is not None and not -MOST_STOPS <= exposure <= MOST_STOPS:
        raise ConfigError(f"--exposure {exposure:g}: accepted: stops from -{MOST_STOPS:g} to {MOST_STOPS:g}")
    if tone_mapping not in (None, *TONE_MAPPINGS):
        accepted = ", ".join(TONE_MAPPINGS)
        near = nearest(str(tone_mapping), TONE_MAPPINGS)
        raise ConfigError(f"--tone-mapping {tone_mapping}: is not known; accepted: {accepted}{near}")
    given = {"exposure": exposure, "tone_mapping": tone_mapping}
    update = {key: value for key, value in given.items() if value is not None}
    views = tuple(view.model_copy(update=update) for view in loaded.config.views)
    return loaded.with_config(loaded.config.model_copy(update={"views": views}))


def nearest(word: str, known: Iterable[str]) -> str:
    """ "; did you mean X?" if one of the known words is close, else nothing."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"; did you mean {close[0]}?" if close else ""


def shown(path: YamlPath) -> str:
    """A YAML path as people write it: views[0].camera.fov."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{_plain(step)}" for step in path)
    return text.removeprefix(".")


def _plain(key: str) -> str:
    """A key as it stands, or quoted if it is long or holds what would spoil a line."""
    return key if key.isprintable() and 0 < len(key) <= 60 else _short(key)


def _near_file(path: Path) -> str:
    folder = path.parent
    if not folder.is_dir():
        return "; wall examples configs copies those that come with the program" * ("configs" in path.parts)
    return nearest(path.name, (p.name for p in folder.iterdir()))


def _refusal(lines: list[tuple[yaml_text.Position | None, str]]) -> ConfigError:
    lines = sorted(lines, key=lambda pair: (pair[0].line, pair[0].column) if pair[0] else (0, 0))
    return ConfigError("\n".join(dict.fromkeys(text for _, text in lines)))


def _check_version(name: str, document: Document) -> None:
    """The error for a file of another version, in place of all that follow from it."""
    values: Mapping[str, Any] = document.values
    version = values.get("version", _ABSENT)
    if version is _ABSENT:
        raise ConfigError(_line(name, document, ("version",), "is missing", accepted=f"version: {VERSION}"))
    if version != VERSION or isinstance(version, (bool, float)):
        raise ConfigError(_line(name, document, ("version",), "this version is not known", accepted=str(VERSION)))


def _has(values: Any, step: str | int) -> bool:
    if isinstance(values, dict):
        return step in values
    return isinstance(values, list) and isinstance(step, int) and step < len(values)


def _value_at(values: Any, path: YamlPath) -> Any:
    for step in path:
        if not _has(values, step):
            return _ABSENT
        values = values[step]
    return values


def _line(
    name: str,
    document: Document,
    path: YamlPath,
    message: str,
    *,
    accepted: str = "",
    near: str = "",
    key: bool = False,
    position: yaml_text.Position | None = None,
) -> str:
    position = position or document.position(path, key=key)
    where = f"{name}:{position.line}:{position.column}" if position else name
    value = _value_at(document.values, path)
    what = shown(path)
    if what and not key and value is not _ABSENT and not isinstance(value, dict):
        what += f" = {_short(value)}"
    parts = [where, what, message] if what else [where, message]
    return ": ".join(parts) + (f"; accepted: {accepted}" if accepted else "") + near


def _path_of(named: str) -> YamlPath:
    """The path of `scene.data[0].file`."""
    return tuple(int(part) if part.isdecimal() else part for part in re.findall(r"\w+", named))


def _short(value: Any) -> str:
    if value is None:
        return "null"
    text = {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _yaml_path(values: Any, details: ErrorDetails) -> YamlPath:
    """pydantic's location without the union tags in it, plus the `at` of our own refusals."""
    location = details["loc"]
    path: list[str | int] = []
    tagged = False
    for i, step in enumerate(location):
        kinds = [values.get(key) for key in ("type", "op", "method")] if isinstance(values, dict) else []
        if not tagged and step in kinds:
            tagged = True
            continue
        if _has(values, step):
            values, tagged = values[step], False
            path.append(step)
        elif i == len(location) - 1 and details["type"] in ("missing", "extra_forbidden"):
            path.append(step)
    return (*path, *details.get("ctx", {}).get("at", ()))


def _is_echo(value: Any, details: ErrorDetails, *, around: bool) -> bool:
    """Whether a refusal only repeats others: of a list that is too short without its entries that were refused, or of
    a value that is of no other kind either, while in itself, or in it, something is wrong (`around`)."""
    if details["type"] == "too_short":
        return bool(len(value) >= details["ctx"]["min_length"])
    return around and details["type"].endswith("_type")


def _explained(name: str, document: Document, details: ErrorDetails) -> tuple[yaml_text.Position | None, str]:
    path, kind = _yaml_path(document.values, details), details["type"]
    key = kind in ("extra_forbidden", "missing")
    near = ""
    if kind == "extra_forbidden":
        known = json_schema.keys_of(json_schema.at(path[:-1], document.values))
        message, accepted, near = "unknown key", ", ".join(known), nearest(str(path[-1]), known)
    elif kind == "refused":
        message, accepted = details["ctx"]["problem"], details["ctx"]["accepted"]
    elif kind in ("union_tag_invalid", "union_tag_not_found"):
        path, message, tags = _untagged(document, path, details)
        accepted, near = ", ".join(tags), nearest(str(_value_at(document.values, path)), tags)
    else:
        part = json_schema.at(path, document.values)
        message, accepted = _message(kind, details), json_schema.accepted(part)
        near = nearest(str(_value_at(document.values, path)), json_schema.choices(part))
    position = document.position(path, key=key)
    return position, _line(name, document, path, message, accepted=accepted, near=near, key=key)


def _untagged(document: Document, path: YamlPath, details: ErrorDetails) -> tuple[YamlPath, str, list[str]]:
    """A mapping of several kinds that does not say which, or says one that is not known."""
    part = json_schema.at(path, document.values)
    value = _value_at(document.values, path)
    if not isinstance(value, dict):
        return path, "is not a mapping", [json_schema.accepted(part)]
    key, kinds = str(details["ctx"]["discriminator"]).strip("'"), part[json_schema.KINDS]
    return ((*path, key), "is not known", kinds) if key in value else (path, f"{key} is missing", kinds)


def _message(kind: str, details: ErrorDetails) -> str:
    """Short words for pydantic's own errors; what is accepted comes from the schema."""
    known = {
        "missing": "is missing",
        "finite_number": "is not a finite number",
        "float_type": "is not a number",
        "int_type": "is not a whole number",
        "bool_type": "is not true or false",
        "string_type": "is not text",
        "literal_error": "is not one of the choices",
        "tuple_type": "is not a list",
        "model_type": "is not a mapping",
        "model_attributes_type": "is not a mapping",
        "string_too_short": "is empty",
        "string_too_long": "is too long",
        "string_pattern_mismatch": "has characters that are not allowed",
        "too_short": "has too few entries",
        "too_long": "has too many entries",
        "greater_than_equal": "is too small",
        "greater_than": "is too small",
        "less_than_equal": "is too large",
        "less_than": "is too large",
    }
    return known.get(kind) or details["msg"][:1].lower() + details["msg"][1:]
