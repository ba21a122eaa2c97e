"""Models of `scene:`: source, lights, sky, and how objects and lights move."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field, model_validator

from wall.config.materials import IntegratorConfig, MaterialConfig
from wall.config.scene_data import DataConfig
from wall.core.fields import (
    MOST_STRENGTH,
    Color,
    Coordinate,
    Direction,
    Flag,
    Model,
    Number,
    Period,
    Point,
    Positive,
    Seconds,
    Text,
    Whole,
    check_one_named,
    check_times,
    refusal,
)

MOST_CUTS = 6  # every ray meets each of them
FLATTEST_RECTANGLE = 1e-6  # sine of the angle between a rectangle's edges


class PointLightConfig(Model):
    """A light that shines equally in all directions."""

    type: Literal["point"] = Field(description="a light at a point")
    position: Point = Field(description="where it stands, world units")
    intensity: Color = Field(description="linear RGB, W/sr")


class SpotLightConfig(Model):
    """A light that shines from a point into a cone."""

    type: Literal["spot"] = Field(description="a light at a point that shines into a cone")
    position: Point = Field(description="where it stands, world units")
    direction: Direction = Field(description="in which it shines, away from it, world frame, any length")
    intensity: Color = Field(description="linear RGB along its direction, W/sr")
    inner_angle: Annotated[Number, Ge(0.0), Lt(90.0)] = Field(
        default=0.0, description="degrees from the direction up to which it shines with all its intensity"
    )
    outer_angle: Annotated[Number, Gt(0.0), Le(90.0)] = Field(
        default=45.0, description="degrees from the direction where its light ends, fading smoothly"
    )

    @model_validator(mode="after")
    def _fades(self) -> SpotLightConfig:
        if self.inner_angle >= self.outer_angle:
            raise refusal(
                f"is not below outer_angle, {self.outer_angle:g}",
                accepted=f"0 to less than {self.outer_angle:g}",
                at=("inner_angle",),
            )
        return self


class DirectionalLightConfig(Model):
    """A light so far away that its rays are parallel: the sun."""

    type: Literal["directional"] = Field(description="parallel light, like the sun's")
    direction: Direction = Field(description="from the surface towards the light, world frame, any length")
    irradiance: Color = Field(description="linear RGB on a surface that faces the light, W/m^2")
    angular_diameter: Annotated[Number, Ge(0.0), Le(180.0)] = Field(
        default=0.0, description="degrees of its disc, for soft shadows on paths; the sun's is 0.53"
    )


class _AreaLightConfig(Model):
    center: Point = Field(description="its middle, world units")
    radiance: Color = Field(description="linear RGB, W sr^-1 m^-2")
    sides: Literal["front", "both"] = Field(default="front", description="from which it shines")


class RectangleLightConfig(_AreaLightConfig):
    """A rectangle that shines."""

    type: Literal["rectangle"] = Field(description="a rectangle that shines, and that rays see")
    edges: tuple[Point, Point] = Field(
        description="two edges as vectors, world units; from its front the first turns counterclockwise to the second"
    )

    @model_validator(mode="after")
    def _has_area(self) -> RectangleLightConfig:
        (a, b, c), (d, e, f) = self.edges
        area = math.hypot(b * f - c * e, c * d - a * f, a * e - b * d)
        if area <= FLATTEST_RECTANGLE * math.hypot(a, b, c) * math.hypot(d, e, f):
            raise refusal("the edges span no area", accepted="two edges that are not parallel", at=("edges",))
        return self


class DiscLightConfig(_AreaLightConfig):
    """A disc that shines."""

    type: Literal["disc"] = Field(description="a disc that shines, and that rays see")
    normal: Direction = Field(description="towards its front, world frame, any length")
    radius: Positive = Field(description="world units")


LightConfig = Annotated[
    PointLightConfig | SpotLightConfig | DirectionalLightConfig | RectangleLightConfig | DiscLightConfig,
    Field(discriminator="type"),
]


class SkyConfig(Model):
    """What rays see that leave the scene: a gradient by height."""

    zenith: Color = Field(default=(0.35, 0.55, 0.95), description="radiance straight up, linear RGB")
    horizon: Color = Field(default=(0.9, 0.95, 1.0), description="radiance at the horizon, linear RGB")
    ground: Color = Field(default=(0.25, 0.23, 0.2), description="radiance straight down, linear RGB")


class EnvironmentConfig(Model):
    """What rays see that leave the scene: an image of all directions."""

    file: Text = Field(
        description="a lat-long image, twice as wide as high: .hdr, .exr, .png, .jpg, relative to this file; "
        "its middle is seen along -z"
    )
    rotation: Annotated[Number, Ge(-36000.0), Le(36000.0)] = Field(
        default=0.0, description="degrees about +y, counterclockwise seen from above"
    )
    strength: Annotated[Number, Ge(0.0), Le(MOST_STRENGTH)] = Field(default=1.0, description="factor of its radiance")


class RotationConfig(Model):
    """A turn about an axis through the object's own centre."""

    axis: Direction = Field(description="axis of the turn, world frame, any length")
    degrees: Annotated[Number, Ge(-36000.0), Le(36000.0)] = Field(
        description="angle, counterclockwise seen from the axis' tip"
    )


class KeyframeConfig(Model):
    """Where something is at one time."""

    time: Seconds = Field(description="seconds of the animation")
    position: Point = Field(description="where its centre is then, world units")
    rotation: RotationConfig | None = Field(
        default=None, description="how it is turned then; absent = as in the source"
    )


class SpinConfig(Model):
    """An object that turns on the spot."""

    type: Literal["spin"] = Field(description="turn about an axis through a centre")
    object: Text = Field(description="name of the object, or a pattern with * and ?")
    axis: Direction = Field(default=(0.0, 1.0, 0.0), description="axis, world frame, any length")
    period_s: Period = Field(description="seconds for a full turn")
    center: Point | None = Field(
        default=None, description="a point of the axis, world units; absent = the object's own centre"
    )


class _MovesObjectOrLight(Model):
    object: Text | None = Field(default=None, description="name of the object, or a pattern with * and ?")
    light: Annotated[Whole, Ge(0), Le(65535)] | None = Field(
        default=None, description="index of the light in scene.lights, from 0"
    )

    @model_validator(mode="after")
    def _one_target(self) -> _MovesObjectOrLight:
        check_one_named("object", self.object, "light", self.light)
        return self


class OrbitConfig(_MovesObjectOrLight):
    """An object or light that circles a centre."""

    type: Literal["orbit"] = Field(description="circle a centre, keeping the distance it has at the start")
    center: Point = Field(description="centre of the circle, world units")
    axis: Direction = Field(default=(0.0, 1.0, 0.0), description="axis, world frame, any length")
    period_s: Period = Field(description="seconds for a full circle")


class KeyframesConfig(_MovesObjectOrLight):
    """An object or light that moves through given positions at given times."""

    type: Literal["keyframes"] = Field(description="move through given positions at given times")
    keyframes: Annotated[tuple[KeyframeConfig, ...], Field(min_length=1, max_length=10000)] = Field(
        description="positions with growing times"
    )
    loop: Flag = Field(default=True, description="begin again after the last keyframe; false = stay there")

    @model_validator(mode="after")
    def _times_grow(self) -> KeyframesConfig:
        check_times([k.time for k in self.keyframes])
        if self.light is not None:
            for i, keyframe in enumerate(self.keyframes):
                if keyframe.rotation is not None:
                    raise refusal("a light has no rotation", accepted="time, position", at=("keyframes", i, "rotation"))
        return self


class ParameterKeyframeConfig(Model):
    """What a parameter is at one time."""

    time: Seconds = Field(description="seconds of the animation")
    value: Coordinate | Annotated[tuple[Coordinate, ...], Field(min_length=1, max_length=16)] = Field(
        description="number, which counts for all of several, or numbers, as `wall set` takes them"
    )


class ParameterConfig(Model):
    """A parameter, as `wall set` sets it, that changes with time."""

    type: Literal["parameter"] = Field(description="change a parameter: straight lines between given values")
    name: Text = Field(description="its name, as `wall set --list` shows it")
    keyframes: Annotated[tuple[ParameterKeyframeConfig, ...], Field(min_length=1, max_length=10000)] = Field(
        description="values with growing times"
    )
    loop: Flag = Field(default=True, description="begin again after the last keyframe; false = stay there")

    @model_validator(mode="after")
    def _times_grow(self) -> ParameterConfig:
        check_times([k.time for k in self.keyframes])
        counts = [len(numbers) for numbers in self.numbers]
        for i, count in enumerate(counts):
            if count not in (1, max(counts)):
                raise refusal(
                    f"has {count} numbers, another keyframe {max(counts)}",
                    accepted="as many numbers in each, or one that counts for all",
                    at=("keyframes", i, "value"),
                )
        return self

    @property
    def numbers(self) -> list[tuple[float, ...]]:
        """Of each keyframe."""
        return [k.value if isinstance(k.value, tuple) else (k.value,) for k in self.keyframes]


MotionConfig: TypeAlias = SpinConfig | OrbitConfig | KeyframesConfig  # of bodies
AnimationConfig = Annotated[MotionConfig | ParameterConfig, Field(discriminator="type")]


class CutConfig(Model):
    """A plane that cuts the scene open."""

    position: Point = Field(description="a point of the plane, world units")
    normal: Direction = Field(
        description="at a right angle to the plane, world frame, any length; the side to which it points is removed"
    )
    enabled: Flag = Field(default=True, description="whether it cuts; false = as if it were not there")


Up = Literal["auto", "x", "y", "z", "-x", "-y", "-z"]


class SceneConfig(Model):
    """What is rendered."""

    source: Text | Annotated[tuple[Text, ...], Field(min_length=1, max_length=1000)] | None = Field(
        default=None,
        description="a built-in scene (arcade, cornell, courtyard, forest, gallery, gallery_mirrors, museum, spheres), "
        "a .glb, .gltf, .obj, .ply or .stl file relative to this one, or a list of them, in one world",
    )
    data: Annotated[tuple[DataConfig, ...], Field(max_length=1000)] = Field(
        default=(), description="points, surfaces and fields of measurements and simulations, in the same world"
    )
    up: Up = Field(
        default="auto",
        description="which way is up in .obj, .ply and .stl files, which do not say; they are turned so that it is y. "
        "auto: z in .stl, y in others",
    )
    materials: Annotated[tuple[MaterialConfig, ...], Field(max_length=10000)] = Field(
        default=(), description="materials by name of object or material; later ones win"
    )
    lights: Annotated[tuple[LightConfig, ...], Field(max_length=1024)] | None = Field(
        default=None, description="lights; absent = the source's own, or sensible ones"
    )
    sky: SkyConfig | None = Field(default=None, description="sky; absent = the source's own, or a blue one")
    environment: EnvironmentConfig | None = Field(default=None, description="an image in place of the sky")
    ground: bool = Field(
        default=False, description="a grey ground under the lowest point of everything, for models that bring none"
    )
    animation: Annotated[tuple[AnimationConfig, ...], Field(max_length=10000)] | None = Field(
        default=None, description="motion, and parameters over time; absent = the source's own, [] = nothing moves"
    )
    integrator: IntegratorConfig | None = Field(
        default=None, description="how light is followed; absent = the source's own, or direct"
    )
    cuts: Annotated[tuple[CutConfig, ...], Field(max_length=MOST_CUTS)] = Field(
        default=(), description="planes that cut the scene open: what lies beyond any of them is not there"
    )

    @model_validator(mode="after")
    def _shows_something(self) -> SceneConfig:
        if self.source is None and not self.data:
            raise refusal("names nothing to show", accepted="source: NAME or FILE, or data: [...], or both")
        return self

    @model_validator(mode="after")
    def _one_surrounding(self) -> SceneConfig:
        if self.sky is not None and self.environment is not None:
            raise refusal("names both a sky and an environment", accepted="one of sky, environment")
        return self

    @model_validator(mode="after")
    def _lights_exist(self) -> SceneConfig:
        for i, track in enumerate(self.animation or ()):
            light = getattr(track, "light", None)
            if light is not None and self.lights is not None and light >= len(self.lights):
                raise refusal(
                    f"there are {len(self.lights)} lights in scene.lights",
                    accepted=f"0 to {len(self.lights) - 1}" if self.lights else "no light can be moved",
                    at=("animation", i, "light"),
                )
        return self
