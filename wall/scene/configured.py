"""What a configuration adds to a source: its lights, sky and animation replace the source's own."""

from __future__ import annotations

from dataclasses import replace

from wall.config.scene import (
    AnimationConfig,
    KeyframesConfig,
    LightConfig,
    OrbitConfig,
    PointLightConfig,
    SceneConfig,
)
from wall.scene.animation import Keyframes, Motion, Orbit, Spin, quaternion
from wall.scene.lights import unit
from wall.scene.model import DirectionalLight, Light, PointLight, Sky, Source, Track

AT_REST = (1.0, 0.0, 0.0, 0.0)


def configured(source: Source, config: SceneConfig) -> Source:
    """The source with everything that the configuration says; what it leaves out stays the source's."""
    if config.lights is not None:
        source = replace(source, lights=tuple(_light(light) for light in config.lights))
    if config.sky is not None:
        sky = config.sky
        source = replace(source, sky=Sky(zenith=sky.zenith, horizon=sky.horizon, ground=sky.ground))
    if config.animation is not None:
        source = replace(source, animation=tuple(_track(track) for track in config.animation))
    return source


def _light(config: LightConfig) -> Light:
    if isinstance(config, PointLightConfig):
        return PointLight(position=config.position, intensity=config.intensity)
    return DirectionalLight(direction=unit(config.direction), irradiance=config.irradiance)


def _track(config: AnimationConfig) -> Track:
    light = getattr(config, "light", None)
    return Track(motion=_motion(config), objects=config.object or "", light=-1 if light is None else light)


def _motion(config: AnimationConfig) -> Motion:
    if isinstance(config, KeyframesConfig):
        turns = [(key.rotation.axis, key.rotation.degrees) if key.rotation else None for key in config.keyframes]
        return Keyframes(
            times=tuple(key.time for key in config.keyframes),
            positions=tuple(key.position for key in config.keyframes),
            rotations=tuple(quaternion(*turn) if turn else AT_REST for turn in turns),
            loop=config.loop,
        )
    if isinstance(config, OrbitConfig):
        return Orbit(center=config.center, axis=config.axis, period_s=config.period_s)
    return Spin(axis=config.axis, period_s=config.period_s, center=config.center)
