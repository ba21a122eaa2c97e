"""Light for models that bring none: a key light from above the viewer's shoulder and a soft grey-blue studio.

The tracer's radiance of a diffuse surface is albedo (E_light cos / pi + E_sky / pi), shown as sRGB clipped at 1.
With the values below a surface of albedo 0.8 shows, from the sky alone, 0.47 of full display value where it faces
up and 0.36 where it faces down; 0.85 where it faces the key light (nothing blown out), 0.69 turned 60 degrees away.
"""

from __future__ import annotations

import math
from dataclasses import replace

from wall.config.scene import DirectionalLightConfig, LightConfig, PointLightConfig, SpotLightConfig
from wall.scene.animation import Vector, times
from wall.scene.area_lights import area_light
from wall.scene.model import AreaLight, DirectionalLight, Light, PointLight, Sky, SpotLight

KEY_DIRECTION = (0.45, 0.75, 0.48)  # right, above, towards a viewer who looks along -z
KEY_SHARE = (0.66, 0.63, 0.58)  # irradiance / pi: slightly warm against the cool sky

STUDIO_SKY = Sky(zenith=(0.20, 0.215, 0.245), horizon=(0.25, 0.265, 0.29), ground=(0.07, 0.067, 0.065))


def unit(vector: Vector) -> Vector:
    """The same direction with length 1; the vector must not be zero."""
    length = math.hypot(*vector)
    x, y, z = (part / length for part in vector)
    return (x, y, z)


def directional_light(direction: Vector, share: Vector) -> DirectionalLight:
    """A light from a direction of any length; `share`: its irradiance / pi."""
    r, g, b = (math.pi * part for part in share)
    return DirectionalLight(direction=unit(direction), irradiance=(r, g, b))


def scaled(light: Light, factor: float) -> Light:
    """A light in a world scaled about its origin, which it lights as before: irradiance and radiance stay."""
    if isinstance(light, DirectionalLight):
        return light
    position = times(factor, light.position)
    if isinstance(light, AreaLight):
        return replace(light, position=position, corners=factor * light.corners)
    return replace(light, position=position, intensity=times(factor**2, light.intensity))


def configured_light(config: LightConfig) -> Light:
    """The light that a configuration describes."""
    if isinstance(config, PointLightConfig):
        return PointLight(position=config.position, intensity=config.intensity)
    if isinstance(config, SpotLightConfig):
        return SpotLight(
            position=config.position,
            direction=unit(config.direction),
            intensity=config.intensity,
            inner_angle=config.inner_angle,
            outer_angle=config.outer_angle,
        )
    if isinstance(config, DirectionalLightConfig):
        return DirectionalLight(
            direction=unit(config.direction), irradiance=config.irradiance, angular_diameter=config.angular_diameter
        )
    return area_light(config)


def default_lights() -> tuple[DirectionalLight, ...]:
    """The key light alone; the studio sky fills the shadows. The world's up is +y."""
    return (directional_light(KEY_DIRECTION, KEY_SHARE),)
