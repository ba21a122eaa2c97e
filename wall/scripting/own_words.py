"""What a scene's sources bring, in the words of configurations: to add to it in place of replacing it."""

from __future__ import annotations

from typing import Any

from wall.config.loading import Loaded
from wall.core.errors import ConfigError, SceneError
from wall.scene.lights import default_lights
from wall.scene.model import AreaLight, DirectionalLight, Light, PointLight, Source
from wall.scene.sources import joined, make_sources, sources_of


def source_of(loaded: Loaded) -> Source:
    """Everything that `scene.source` names, in one world. Raises ConfigError."""
    scene = loaded.config.scene
    try:
        return joined(make_sources(sources_of(scene), loaded.folder, scene.up))
    except SceneError as error:
        raise loaded.error(("scene", "source"), str(error)) from error


def lights_of(loaded: Loaded) -> list[dict[str, Any]]:
    """The lights that light a scene without `scene.lights`: the sources' own, or sensible ones."""
    lights = source_of(loaded).lights
    return [_words(light) for light in (default_lights() if lights is None else lights)]


def animation_of(loaded: Loaded) -> list[dict[str, Any]]:
    """The motions of a scene without `scene.animation`. Raises ConfigError where a model's have no words."""
    source = source_of(loaded)
    if source.motions:
        came = f"{loaded.name}: a model moves by its own animation, which cannot be added to"
        raise ConfigError(f"{came}; accepted: set(animation=[...]), which replaces it")
    return [track.model_dump(mode="json", exclude_none=True) for track in source.animation]


def _words(light: Light) -> dict[str, Any]:
    assert not isinstance(light, AreaLight)  # which only configurations bring
    if isinstance(light, DirectionalLight):
        words = {"type": "directional", "direction": light.direction, "irradiance": light.irradiance}
        return words | {"angular_diameter": light.angular_diameter}
    place = {"position": light.position, "intensity": light.intensity}
    if isinstance(light, PointLight):
        return {"type": "point", **place}
    angles = {"inner_angle": light.inner_angle, "outer_angle": light.outer_angle}
    return {"type": "spot", "direction": light.direction, **place, **angles}
