"""The parameters of a scene that can be changed while it is shown: their names, types, ranges, and what is refused.

Only what the scene has, and what its kernels were compiled with, is a parameter: a change needs no new tree or kernel.
A new one: an entry here, and where scene.shading puts its value.
"""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Literal, TypeAlias

from wall.config.views import MOST_STOPS
from wall.core.colour import light_of_code
from wall.core.errors import EditError, SceneError
from wall.core.fields import BRIGHTEST, FARTHEST, LARGEST_IOR, MOST_DEPTH, MOST_STRENGTH, SMALLEST_IOR
from wall.core.tone_mapping import AS_IT_IS, TONE_MAPPINGS, Tone
from wall.scene.build import Scene
from wall.scene.model import Environment, Material
from wall.scene.needs import Needs, needs
from wall.scene.object_edits import OBJECTS, OFFSET, ROTATION, SCALE, VISIBLE
from wall.scene.shading import LIGHT_FIELDS, SKY_COLOURS, material_names

Kind: TypeAlias = Literal["number", "whole", "color", "light", "direction", "position", "angles", "choice"]
Numbers: TypeAlias = tuple[float, ...]

EXPOSURE, TONE_MAPPING, FOCUS = "exposure", "tone_mapping", "lens.focus"
OF_THE_PICTURE = (EXPOSURE, TONE_MAPPING)  # alone: no sample depends on them
WIDTH: Mapping[Kind, int] = {
    "number": 1, "whole": 1, "color": 3, "light": 3, "direction": 3, "position": 3, "angles": 3, "choice": 1,
}  # fmt: skip
NAMES_SHOWN = 8
NEAREST = 1e-6  # world units
SCENES_AWAY = 1e4  # radii of the scene, or world units, that an object may be moved; page/parameters.js has the same
SHORTEST = 1e-9  # length of a direction
SMALLEST_SCALE, LARGEST_SCALE = 1e-3, 1e4  # of an object
SWITCHES = {"true": 1, "false": 0}  # words of YAML, JSON and Python
SRGB = re.compile("#[0-9a-fA-F]{6}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A value that can be changed: `color` is a reflectance, `light` a linear RGB radiometric quantity."""

    name: str  # name path
    kind: Kind
    low: float = 0.0  # of each number
    high: float
    unit: str = ""
    default: Numbers  # the configuration's
    choices: tuple[str, ...] = ()  # of a `choice`, whose value is the place of one of these names

    @property
    def accepted(self) -> str:
        """What it takes, in words."""
        unit, span = f" {self.unit}" if self.unit else "", f"from {self.low:g} to {self.high:g}"
        if self.kind == "choice":
            return f"one of {', '.join(self.choices)}"
        if self._is_switch:
            return "true, false, 1 or 0"
        if self.kind == "whole":
            return f"a whole number {span}{unit}"
        if self.kind == "number":
            return f"a number {span}{unit}"
        if self.kind == "direction":
            return "three numbers, not all zero"
        if self.kind in ("color", "light"):
            return f"three numbers, or one for all of them, {span}{unit}, or #rrggbb"
        return f"three numbers, {span}{unit}"

    @property
    def _is_switch(self) -> bool:
        return self.kind == "whole" and (self.low, self.high) == (0.0, 1.0)

    def checked(self, value: object) -> Numbers:
        """The numbers of a value: a number, a sequence of numbers, or a name. Raises EditError where it is refused."""
        given: list[Any] = list(value) if isinstance(value, list | tuple) else [value]
        given = [self.choices.index(x) if isinstance(x, str) and x in self.choices else x for x in given]
        if self._is_switch:
            given = [SWITCHES.get(str(x).lower(), x) for x in given]
        wanted = WIDTH[self.kind]
        if len(given) == 1 and self.kind in ("color", "light"):
            code = isinstance(given[0], str) and SRGB.fullmatch(given[0])
            given = light_of_code(given[0]) if code else wanted * given
        numbers = [float(x) for x in given if _is_number(x) and self.low <= x <= self.high]
        whole = self.kind not in ("whole", "choice") or all(x == int(x) for x in numbers)
        length = self.kind != "direction" or math.hypot(*numbers) >= SHORTEST
        if len(given) != wanted or len(numbers) != wanted or not whole or not length:
            raise EditError(f"{self.name} = {_shown(value)}: want {self.accepted}")
        return tuple(numbers)


def _is_number(value: Any) -> bool:
    if isinstance(value, int) and not isinstance(value, bool):
        return abs(value) < 1 << 63
    return isinstance(value, float) and math.isfinite(value)


def _shown(value: object) -> str:
    return value[:60] if isinstance(value, str) else reprlib.repr(value)


def parameters_of(scene: Scene, *, tone: Tone = AS_IT_IS) -> dict[str, Parameter]:
    """All parameters of a scene by name, and those of the picture, which are configured as `tone`."""
    wanted = needs(scene)
    found = [
        *_of_the_picture(tone),
        *_lens(scene),
        *_cuts(scene),
        *(_lights(scene) if scene.occlusion is None else ()),
        *(_sky(scene) if scene.environment is None else _environment(scene.environment)),
        *(_materials(scene, wanted) if scene.occlusion is None or scene.occlusion.colors else ()),
    ]
    if scene.occlusion is not None:
        distance: dict[str, Any] = {"low": NEAREST, "high": FARTHEST, "unit": "world units"}
        default = (scene.occlusion.distance,)
        found.append(Parameter(name="integrator.distance", kind="number", default=default, **distance))
    elif scene.path_depth is not None:
        depth = (float(scene.path_depth),)
        found.append(
            Parameter(name="integrator.depth", kind="whole", low=1, high=MOST_DEPTH, unit="surfaces", default=depth)
        )
    found += _objects(scene)
    return {parameter.name: parameter for parameter in found}


def _of_the_picture(tone: Tone) -> Iterator[Parameter]:
    stops: dict[str, Any] = {"low": -MOST_STOPS, "high": MOST_STOPS, "unit": "stops"}
    yield Parameter(name=EXPOSURE, kind="number", default=(tone.stops,), **stops)
    last, mapping = len(TONE_MAPPINGS) - 1, (float(tone.code),)
    yield Parameter(name=TONE_MAPPING, kind="choice", high=last, default=mapping, choices=TONE_MAPPINGS)


def parameters_of_views(scenes: Sequence[Scene], *, tone: Tone = AS_IT_IS) -> dict[str, Parameter]:
    """Those that any view of a scene has, with the values of the first that has it; of objects, those that all have.

    scenes : one scene as each view shows it: an emitter that cannot be hidden in one view is hidden in none
    """
    each = [parameters_of(scene, tone=tone) for scene in {id(scene): scene for scene in scenes}.values()]
    found: dict[str, Parameter] = {}
    for parameters in each:
        found |= {name: parameter for name, parameter in parameters.items() if name not in found}
    return {
        name: parameter
        for name, parameter in found.items()
        if not name.startswith(OBJECTS) or all(name in parameters for parameters in each)
    }


def _lens(scene: Scene) -> Iterator[Parameter]:
    if scene.lens is not None:
        width: dict[str, Any] = {"kind": "number", "high": FARTHEST, "unit": "world units"}
        yield Parameter(name="lens.aperture", default=(scene.lens.aperture,), **width)
        yield Parameter(name=FOCUS, low=NEAREST, default=(scene.lens.focus,), **width)


def _cuts(scene: Scene) -> Iterator[Parameter]:
    far: dict[str, Any] = {"low": -FARTHEST, "high": FARTHEST}
    for number, cut in enumerate(scene.cuts):
        path, enabled = f"cuts.{number}", (float(cut.enabled),)
        yield Parameter(name=f"{path}.position", kind="position", unit="world units", default=cut.position, **far)
        yield Parameter(name=f"{path}.normal", kind="direction", default=cut.normal, **far)
        yield Parameter(name=f"{path}.enabled", kind="whole", low=0, high=1, default=enabled)


def _lights(scene: Scene) -> Iterator[Parameter]:
    of_field: dict[str, tuple[Kind, float, float, str]] = {
        "position": ("position", -FARTHEST, FARTHEST, "world units"),
        "intensity": ("light", 0.0, BRIGHTEST, "W/sr"),
        "direction": ("direction", -FARTHEST, FARTHEST, ""),
        "irradiance": ("light", 0.0, BRIGHTEST, "W/m²"),
    }
    for number, light in enumerate(scene.lights):
        for name in LIGHT_FIELDS:
            if hasattr(light, name):
                kind, low, high, unit = of_field[name]
                path, value = f"lights.{number}.{name}", getattr(light, name)
                yield Parameter(name=path, kind=kind, low=low, high=high, unit=unit, default=value)


def _sky(scene: Scene) -> Iterator[Parameter]:
    yield Parameter(name="sky.strength", kind="number", high=MOST_STRENGTH, default=(1.0,))
    for name in SKY_COLOURS:
        colour = getattr(scene.sky, name)
        yield Parameter(name=f"sky.{name}", kind="light", high=BRIGHTEST, unit="W/(sr m²)", default=colour)


def _environment(environment: Environment) -> Iterator[Parameter]:
    if environment.strength > 0.0:  # else there is no light to multiply
        strength = (environment.strength,)
        yield Parameter(name="environment.strength", kind="number", high=MOST_STRENGTH, default=strength)


def _objects(scene: Scene) -> Iterator[Parameter]:
    """All objects of a name are one. Emitters on paths can be neither hidden nor scaled: they are sampled as light, by
    their areas at rest."""
    shine = {k for k, material in enumerate(scene.materials) if scene.path_depth and max(material.emission) > 0.0}
    found = [instance for instance in scene.instances if scene.meshes[instance.mesh].material in shine]
    lamps = {name for instance in found for name in (instance.name, *instance.parents)}
    for name in dict.fromkeys(instance.name for instance in scene.instances):
        path, far = f"{OBJECTS}{name}", SCENES_AWAY * max(scene.radius, 1.0)
        yield Parameter(
            name=f"{path}.{OFFSET}", kind="position", low=-far, high=far, unit="world units", default=(0.0, 0.0, 0.0)
        )
        yield Parameter(
            name=f"{path}.{ROTATION}", kind="angles", low=-360.0, high=360.0, unit="degrees", default=(0.0, 0.0, 0.0)
        )
        if name not in lamps:
            yield Parameter(
                name=f"{path}.{SCALE}", kind="number", low=SMALLEST_SCALE, high=LARGEST_SCALE, default=(1.0,)
            )
            yield Parameter(name=f"{path}.{VISIBLE}", kind="whole", low=0, high=1, default=(1.0,))


def _materials(scene: Scene, wanted: Needs) -> Iterator[Parameter]:
    used = {scene.meshes[instance.mesh].material for instance in scene.instances}
    for number, name in enumerate(material_names(scene.materials)):
        if number in used:
            yield from _of_material(scene.materials[number], f"materials.{name}", wanted)


def _of_material(material: Material, path: str, wanted: Needs) -> Iterator[Parameter]:
    """What kernels read of a material in this scene, and were compiled to."""
    clear = wanted.paths and material.transmission > 0.0 and not wanted.occlusion
    share: dict[str, Any] = {"kind": "number", "high": 1.0}
    yield Parameter(name=f"{path}.color", kind="color", high=1.0, default=material.base_color)
    if wanted.interfaces or clear:
        yield Parameter(name=f"{path}.roughness", default=(material.roughness,), **share)
        ior = (material.ior,)
        yield Parameter(name=f"{path}.ior", kind="number", low=SMALLEST_IOR, high=LARGEST_IOR, default=ior)
    if clear and max(material.absorption) > 0.0:
        yield Parameter(name=f"{path}.attenuation_color", kind="color", high=1.0, default=material.attenuation_color)
        name, distance = f"{path}.attenuation_distance", (material.attenuation_distance,)
        yield Parameter(name=name, kind="number", high=FARTHEST, unit="world units", default=distance)
    if wanted.interfaces:
        yield Parameter(name=f"{path}.metallic", default=(material.metallic,), **share)
    if wanted.occlusion:
        return
    if max(material.emission) > 0.0:
        lit = material.emission
        yield Parameter(name=f"{path}.emission", kind="light", high=BRIGHTEST, unit="W/(sr m²)", default=lit)
    if material.mirror > 0.0:
        yield Parameter(name=f"{path}.mirror", default=(material.mirror,), **share)


def named(parameters: Mapping[str, Parameter], name: str) -> Parameter:
    """The parameter of a name. Raises EditError where there is none, with those that are meant."""
    if (found := parameters.get(name)) is not None:
        return found
    if "*" in name or "?" in name:
        raise EditError(
            f"{_shown(name)}: a pattern; wanted: one parameter's name; wall set --list 'x*' shows those with x"
        )
    head = name.split(".")[0]
    own = [path for path in parameters if path.split(".")[0] == head]
    near = get_close_matches(name, own or parameters, n=1)
    meant = f"did you mean {near[0]}? " if near else ""
    known = own or sorted({path.split(".")[0] for path in parameters})
    more = f" and {len(known) - NAMES_SHOWN} more" if len(known) > NAMES_SHOWN else ""
    raise EditError(f"{_shown(name)}: no such parameter; {meant}there are {', '.join(known[:NAMES_SHOWN])}{more}")


def with_checked_tracks(scene: Scene, parameters: Mapping[str, Parameter]) -> Scene:
    """The scene with every keyframe's numbers as its parameter takes them.

    Raises SceneError where one names none of the `parameters`, or is refused by it.
    """
    if not scene.parameter_tracks:
        return scene
    tracks = []
    for track in scene.parameter_tracks:
        try:
            parameter = named(parameters, track.name)
            if parameter.kind == "choice":
                raise EditError(f"{track.name}: nothing lies between its values; wanted: no keyframes")
            rows = [parameter.checked(row) for row in track.values.tolist()]
        except EditError as error:
            raise SceneError(f"scene.animation, type parameter: {error}") from error
        tracks.append(track.with_values(rows))
    return replace(scene, parameter_tracks=tuple(tracks))
