"""A scene that Python opens and adds to, in the words of configurations, checked as these are."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wall.commands.inputs import load_any
from wall.config.loading import Loaded, load_values, with_up
from wall.core.errors import ConfigError
from wall.roles.plan import Plan, aimed, load_scene, make_layout
from wall.scene.build import Scene as BuiltScene
from wall.scene.sources import is_built_in
from wall.scripting.own_words import animation_of, lights_of
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene


class Scene:
    """What is rendered, with its wall and views: opened from a file or by name, then added to.

    >>> scene = wall.Scene("cornell")  # a built-in scene, a model file, or a configuration
    >>> scene.add_object("bunny.glb")
    >>> scene.add_light(type="point", position=(0, 2, 0), intensity=(5, 5, 5))
    >>> scene.add_material(type="metal", object="bunny", roughness=0.1)

    Models and built-in scenes get the wall of `wall run MODEL`: 2 x 2 panels of 480 x 270 pixels. Each method checks
    everything that was said so far; it raises ConfigError, as a file with these values would, and then changes nothing.
    Names in models, and patterns that are to match them, are checked once models are loaded: by `objects` or a render.
    """

    def __init__(self, source: str | Path, *, up: str | None = None) -> None:
        """`up`: the direction that is up in .obj, .ply and .stl files, as in `scene.up`. Raises ConfigError."""
        loaded = load_any(source)
        self._loaded = loaded if up is None else with_up(loaded, up)
        self._values: dict[str, Any] = copy.deepcopy(loaded.document.values)
        if up is not None:
            self._values["scene"]["up"] = up
        self._built: tuple[Loaded, BuiltScene, TracerScene] | None = None

    def __repr__(self) -> str:
        return f"<wall.Scene of {self._loaded.name}>"

    @property
    def loaded(self) -> Loaded:
        """The checked configuration."""
        return self._loaded

    @property
    def values(self) -> dict[str, Any]:
        """Everything that was said, as plain values of a configuration; a copy."""
        return copy.deepcopy(self._values)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed or repaired in its models. Loads them."""
        return self._traced(self._loaded)[0].notes

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of its objects, for patterns of `add_material` and `add_animation`. Loads its models."""
        return tuple(dict.fromkeys(instance.name for instance in self._traced(self._loaded)[0].instances))

    def add_object(self, source: str | Path) -> None:
        """Put another model file, or built-in scene, into the same world; relative to the current folder.

        Its objects are in `objects`, by the names that its file gives them.
        """
        if not is_built_in(source) and not Path(source).is_file():
            raise ConfigError(f"{source}: no such file, nor a built-in scene")
        name = str(source) if is_built_in(source) else str(Path(source).absolute())
        now = self._values["scene"].get("source") or []
        self.set(source=[*(now if isinstance(now, list) else [now]), name])

    def add_light(self, **words: Any) -> None:
        """Add a light, in the words of `scene.lights`: type, position, intensity... Those of the source stay."""
        self._add("lights", words, own=lights_of)

    def add_material(self, **words: Any) -> None:
        """Give objects or materials of the source another look, in the words of `scene.materials`; the last wins."""
        self._add("materials", words)

    def add_animation(self, **words: Any) -> None:
        """Add a motion, in the words of `scene.animation`. Those of the source stay."""
        self._add("animation", words, own=animation_of)

    def add_cut(self, **words: Any) -> None:
        """Add a plane that cuts the scene open, in the words of `scene.cuts`."""
        self._add("cuts", words)

    def set(self, **sections: Any) -> None:
        """Replace sections of `scene:`, such as sky, environment, integrator or up; None removes one."""
        values = copy.deepcopy(self._values)
        for name, value in sections.items():
            if value is None:
                values["scene"].pop(name, None)
            else:
                values["scene"][name] = plain(value)
        self._loaded, self._values = self._checked(values), values

    def _add(
        self, name: str, words: Mapping[str, Any], *, own: Callable[[Loaded], list[dict[str, Any]]] = lambda _: []
    ) -> None:
        """Add an entry to a list of `scene:`, after those that are there; `own`: those of a list that is absent."""
        before = self._values["scene"].get(name)
        self.set(**{name: [*(own(self._loaded) if before is None else before), dict(words)]})

    def _checked(self, values: dict[str, Any]) -> Loaded:
        return load_values(values, name=self._loaded.name, path=self._loaded.path)

    def with_views(self, numbers: Iterable[int], changes: Mapping[str, Any]) -> Loaded:
        """The configuration with other values in some of its views; None removes one. Raises ConfigError."""
        values = copy.deepcopy(self._values)
        for view in (values["views"][number] for number in numbers):
            for name, value in changes.items():
                view.pop(name, None)
                if value is not None:
                    view[name] = plain(value)
        return self._checked(values)

    def planned(self, loaded: Loaded) -> tuple[Plan, TracerScene]:
        """The plan of this scene under a configuration whose `scene:` is this one's, and what traces it.

        Models are loaded once, however often views change. Raises ConfigError.
        """
        layout = make_layout(loaded)
        built, tracer_scene = self._traced(loaded)
        return aimed(layout, built), tracer_scene

    def _traced(self, loaded: Loaded) -> tuple[BuiltScene, TracerScene]:
        if self._built is None or self._built[0].config.scene != loaded.config.scene:
            built = load_scene(make_layout(loaded))
            self._built = loaded, built, make_tracer_scene(built)
        return self._built[1:]


def plain(value: Any) -> Any:
    """A value as YAML would have it: lists, mappings, texts, numbers. Raises ConfigError for anything else."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise ConfigError(f"{value!r} is no value of a configuration; accepted: texts, numbers, lists, mappings")
