"""The shading of a scene with some of its parameters replaced. Values were checked by scene.parameters; names of what
a scene does not have change nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias, TypeVar, cast

from wall.geometry.lens import Lens
from wall.scene.lights import unit
from wall.scene.model import Cut, Light, Material, Shading, Sky
from wall.scene.object_edits import OBJECTS

Values: TypeAlias = Mapping[str, tuple[float, ...]]  # by name path

AnyLight = TypeVar("AnyLight", bound=Light)

LIGHT_FIELDS = ("position", "intensity", "direction", "irradiance")  # of any kind of light that has them
CUT_FIELDS = ("position", "normal")  # beside whether it is enabled
SKY_COLOURS = ("zenith", "horizon", "ground")
MATERIAL_FIELDS = {  # name in a path: field of Material
    "color": "base_color",
    "roughness": "roughness",
    "metallic": "metallic",
    "ior": "ior",
    "attenuation_color": "attenuation_color",
    "attenuation_distance": "attenuation_distance",
    "emission": "emission",
    "mirror": "mirror",
}


def material_names(materials: Sequence[Material]) -> list[str]:
    """A name for each material that no other has: its own, numbered from the second that has it."""
    counts, names = Counter[str](), dict[str, None]()
    for material in materials:
        own = name = material.name or "material"
        while name in names:
            counts[own] += 1
            name = f"{own} #{counts[own] + 1}"
        names[name] = None
    return list(names)


def shaded(base: Shading, lights: Sequence[Light | None], values: Values) -> Shading:
    """`base` with these values. `lights`: its lights, in the order in which they are named; None: of another kind."""
    if not values:
        return base
    new = {id(light): _light(light, k, values) for k, light in enumerate(lights) if light is not None}
    return Shading(
        point_lights=_edited(base.point_lights, new),
        spot_lights=_edited(base.spot_lights, new),
        directional_lights=_edited(base.directional_lights, new),
        sky=_sky(base.sky, values),
        materials=_materials(base.materials, values),
        path_depth=None if base.path_depth is None else int(_number(values, "integrator.depth", base.path_depth)),
        lens=_lens(base.lens, values),
        environment_strength=_number(values, "environment.strength", base.environment_strength),
        occlusion_distance=_number(values, "integrator.distance", base.occlusion_distance),
        cuts=_cuts(base.cuts, values),
        objects=tuple((path, value) for path, value in sorted(values.items()) if path.startswith(OBJECTS)),
    )


def _edited(lights: tuple[AnyLight, ...], new: Mapping[int, Light]) -> tuple[AnyLight, ...]:
    """Lights of one kind as edited; the same tuple where none was."""
    now = tuple(cast(AnyLight, new.get(id(light), light)) for light in lights)
    return lights if now == lights else now


def _number(values: Values, name: str, otherwise: float) -> float:
    return values.get(name, (otherwise,))[0]


def _lens(lens: Lens | None, values: Values) -> Lens | None:
    if lens is None:
        return None
    aperture = _number(values, "lens.aperture", lens.aperture)
    return Lens(radius=aperture / 2, focus=_number(values, "lens.focus", lens.focus))


def _light(light: Light, number: int, values: Values) -> Light:
    paths = {field: f"lights.{number}.{field}" for field in LIGHT_FIELDS if hasattr(light, field)}
    wanted: dict[str, Any] = {field: values[path] for field, path in paths.items() if path in values}
    if any(wanted.get("direction", ())):  # keyframes may pass through no direction at all: it lights nothing then
        wanted["direction"] = unit(wanted["direction"])
    return replace(light, **wanted)


def _cuts(cuts: tuple[Cut, ...], values: Values) -> tuple[Cut, ...]:
    now = tuple(_cut(cut, f"cuts.{k}", values) for k, cut in enumerate(cuts))
    return cuts if now == cuts else now


def _cut(cut: Cut, path: str, values: Values) -> Cut:
    wanted: dict[str, Any] = {field: values.get(f"{path}.{field}", getattr(cut, field)) for field in CUT_FIELDS}
    return Cut(enabled=_number(values, f"{path}.enabled", cut.enabled) >= 0.5, **wanted)


def _sky(sky: Sky, values: Values) -> Sky:
    colours = {name: values.get(f"sky.{name}", getattr(sky, name)) for name in SKY_COLOURS}
    strength = _number(values, "sky.strength", 1.0)
    now = Sky(**{name: tuple(strength * part for part in colour) for name, colour in colours.items()})
    return sky if now == sky else now


def _materials(materials: tuple[Material, ...], values: Values) -> tuple[Material, ...]:
    wanted: dict[str, dict[str, Any]] = {}
    for path, value in values.items():
        head, _, rest = path.partition(".")
        name, _, field = rest.rpartition(".")
        if head == "materials" and field in MATERIAL_FIELDS:
            wanted.setdefault(name, {})[MATERIAL_FIELDS[field]] = value if len(value) > 1 else value[0]
    if not wanted:
        return materials
    names = material_names(materials)
    return tuple(replace(m, **wanted[n]) if n in wanted else m for n, m in zip(names, materials, strict=True))
