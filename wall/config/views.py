"""Models of `views:`: the camera, the eye, and how the camera moves."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le
from pydantic import BeforeValidator, Field, model_validator

from wall.config.materials import IntegratorConfig
from wall.config.sampling import SamplingConfig
from wall.config.tracking import TrackingConfig
from wall.core.fields import (
    Direction,
    Flag,
    Model,
    Name,
    Number,
    Period,
    Point,
    Positive,
    Reflectance,
    RefreshRate,
    Seconds,
    Share,
    Text,
    check_times,
    refusal,
)
from wall.core.tone_mapping import ToneMapping
from wall.operators.outline import LineWidth

DEFAULT_FOV_DEGREES = 45.0
ROUNDED = 1.0 + 1e-9  # shares that were worked out are not exact
MOST_VIEWS = 64
MOST_STOPS = 20.0  # of exposure: a million times as bright
MOST_OFFSET_S = 1e6  # of a view's time

ReconstructionWish = Literal["auto", "cpu", "gpu"]


class CameraConfig(Model):
    """Where the viewer stands in the world. Without name, position and follow, the whole scene is framed."""

    name: Text | None = Field(
        default=None,
        description="a camera of the scene's source (glTF); in place of position and target",
    )
    position: Point | None = Field(
        default=None, description="where the eye is, world units; absent = framed automatically"
    )
    target: Point | None = Field(
        default=None, description="what it looks at, world units; absent = framed automatically"
    )
    direction: Direction | None = Field(
        default=None,
        description="which way it looks where the scene is framed automatically, world frame; absent = from the front "
        "right and a little above",
    )
    up: Direction = Field(default=(0.0, 1.0, 0.0), description="the direction that is up in the image, world frame")
    fov: Annotated[Number, Ge(1.0), Le(170.0)] | None = Field(
        default=None,
        description="vertical field of view over the whole wall, degrees; absent = 45, or what `eye` or the named "
        "camera gives",
    )

    follow: Name | None = Field(
        default=None,
        description="id of a view before this one, whose camera it has, steered or not; in place of name and position",
    )

    @model_validator(mode="after")
    def _looks_somewhere(self) -> CameraConfig:
        if (self.position is None) != (self.target is None):
            raise refusal("has only one of position and target", accepted="both, or neither (framed automatically)")
        if sum(given is not None for given in (self.name, self.position, self.follow, self.direction)) > 1:
            raise refusal("says more than once where the eye is", accepted="one of name, position, follow, direction")
        if self.position is not None and self.target is not None and _same(self.position, self.target):
            raise refusal("is where the eye is", accepted="a point away from position", at=("target",))
        return self


def _same(a: tuple[float, float, float], b: tuple[float, float, float]) -> bool:
    """Whether two points are too close to give a direction, at their own scale."""
    return math.dist(a, b) <= 1e-9 * max(1.0, *map(abs, a), *map(abs, b))


def _spelled_out(value: Any) -> Any:
    return {} if value == "auto" else value


class OrbitPathConfig(Model):
    """The camera circles its target."""

    type: Literal["orbit"] = Field(description="circle the target about the up direction")
    period_s: Period = Field(default=20.0, description="seconds for a full circle")


class CameraKeyframeConfig(Model):
    """Where the eye is, and what it looks at, at one time."""

    time: Seconds = Field(description="seconds of the animation")
    position: Point = Field(description="where the eye is then, world units")
    target: Point = Field(description="what it looks at then, world units")

    @model_validator(mode="after")
    def _looks_somewhere(self) -> CameraKeyframeConfig:
        if _same(self.position, self.target):
            raise refusal("is where the eye is", accepted="a point away from position", at=("target",))
        return self


class KeyframesPathConfig(Model):
    """The camera moves smoothly through given positions."""

    type: Literal["keyframes"] = Field(description="move through given positions at given times")
    loop: Flag = Field(default=True, description="begin again after the last keyframe; false = stay there")
    keyframes: Annotated[tuple[CameraKeyframeConfig, ...], Field(min_length=1, max_length=10000)] = Field(
        description="positions with growing times"
    )

    @model_validator(mode="after")
    def _times_grow(self) -> KeyframesPathConfig:
        check_times([k.time for k in self.keyframes])
        return self


PathConfig = Annotated[OrbitPathConfig | KeyframesPathConfig, Field(discriminator="type")]
CameraOrAuto = Annotated[
    CameraConfig, BeforeValidator(_spelled_out, json_schema_input_type=Literal["auto"] | CameraConfig)
]


class TimeConfig(Model):
    """Which moment of the scene a view shows: that of another view, shifted, or one of its own."""

    follow: Name | None = Field(
        default=None, description="id of a view before this one, whose time it has; absent = it has a time of its own"
    )
    offset_s: Annotated[Number, Ge(-MOST_OFFSET_S), Le(MOST_OFFSET_S)] = Field(
        default=0.0, description="seconds that are added to it; never before the scene's beginning, 0"
    )
    paused: Flag = Field(default=False, description="whether a time of its own stands still at first")

    @model_validator(mode="after")
    def _one_owner(self) -> TimeConfig:
        if self.follow is not None and self.paused:
            raise refusal("its time follows another view's", accepted="no paused", at=("paused",))
        return self


class SelectionConfig(Model):
    """Which object is selected in a view: that of another view, or one of its own."""

    follow: Name | None = Field(
        default=None, description="id of a view before this one, whose selection it has; absent = one of its own"
    )


def _own(value: Any) -> Any:
    return {} if value == "own" else value


TimeOrOwn = Annotated[TimeConfig, BeforeValidator(_own, json_schema_input_type=Literal["own"] | TimeConfig)]
SelectionOrOwn = Annotated[
    SelectionConfig, BeforeValidator(_own, json_schema_input_type=Literal["own"] | SelectionConfig)
]


class LensConfig(Model):
    """A thin lens: what is not in focus is blurred. On paths alone."""

    aperture: Positive = Field(description="diameter of the lens, world units")
    focus: Positive = Field(description="distance from the eye to the plane in focus, world units")


class ViewportConfig(Model):
    """A rectangle of the wall, bezels included, in shares of its width and height."""

    left: Share = Field(description="share of the wall's width at its left")
    top: Share = Field(description="share of the wall's height above it")
    width: Share = Field(description="share of the wall's width")
    height: Share = Field(description="share of the wall's height")

    @model_validator(mode="after")
    def _lies_on_the_wall(self) -> ViewportConfig:
        for first, size in (("left", "width"), ("top", "height")):
            start, length = getattr(self, first), getattr(self, size)
            if not 0.0 < length <= (1.0 - start) * ROUNDED:
                raise refusal("does not lie on the wall", accepted=f"above 0, up to {1.0 - start:g}", at=(size,))
        return self


class BorderConfig(Model):
    """A line around a view's viewport."""

    width: LineWidth = Field(default=2, description="pixels, inside of the viewport")
    color: Reflectance = Field(default=(1.0, 1.0, 1.0), description="linear RGB, 1: as bright as the display is")


class ViewConfig(Model):
    """One viewer's image."""

    id: Name = Field(default="main", description="name of the view")
    panels: Annotated[tuple[Name, ...], Field(min_length=1, max_length=1024)] | None = Field(
        default=None, description="ids of the panels that show it; absent = all, unless it has a viewport"
    )
    viewport: ViewportConfig | None = Field(
        default=None, description="the part of the wall that shows it; later views lie over earlier ones"
    )
    border: BorderConfig | None = Field(
        default=None, description="a line around its viewport, where a preset makes the graph; absent = none"
    )
    weight: Annotated[Number, Ge(0.001), Le(1000.0)] = Field(
        default=1.0, description="share of a renderer's time that it gets, against the other views of that renderer"
    )
    camera: CameraOrAuto = Field(
        default=CameraConfig(), description="where the viewer stands, or auto: the whole scene is framed"
    )
    eye: Point | None = Field(
        default=None,
        description="the viewer's eye before the wall, metres in the wall's frame; absent = "
        "before its centre at the distance that gives camera.fov",
    )
    eye_separation: Annotated[Number, Ge(0.0), Le(10.0)] = Field(
        default=0.065, description="from the left eye to the right one, metres; for panels with stereo"
    )
    scale: Positive | None = Field(
        default=None,
        description="world units a metre of the wall, for panels with stereo or an eye of their own; absent = such "
        "that the camera's target stands in the wall's plane",
    )
    lens: LensConfig | None = Field(default=None, description="depth of field, on paths; absent = all is in focus")
    tracking: TrackingConfig | None = Field(
        default=None, description="a tracker tells where the viewer's eye is; absent = it stays at `eye`"
    )
    path: PathConfig | None = Field(default=None, description="how the camera moves; absent = it stays")
    time: TimeOrOwn | None = Field(
        default=None, description="which moment of the scene it shows, or own; absent = that of the first view"
    )
    selection: SelectionOrOwn | None = Field(
        default=None, description="which object is selected in it, or own; absent = that of the first view"
    )
    refresh_hz: RefreshRate = Field(default=60.0, description="images shown a second")
    prediction: Literal["velocity", "none"] = Field(
        default="velocity",
        description="velocity: samples go where camera and objects will be when a refresh becomes light, if they go on "
        "as they do; none: where the newest input has them. Only the adaptive sampler moves samples",
    )
    display_delay_s: Annotated[Number, Ge(0.0), Le(1.0)] | None = Field(
        default=None, description="seconds from a refresh to its light; absent = one refresh"
    )
    exposure: Annotated[Number, Ge(-MOST_STOPS), Le(MOST_STOPS)] = Field(
        default=0.0, description="stops: light times 2^exposure is shown"
    )
    tone_mapping: ToneMapping = Field(
        default="none",
        description="how exposed light becomes what is shown. none: as it is, clipped at white; khronos_neutral: "
        "colours stay, highlights go to white softly; aces: filmic; reinhard: x / (1 + x)",
    )
    sampling: SamplingConfig | None = Field(default=None, description="replaces the top-level sampling for this view")
    integrator: IntegratorConfig | None = Field(
        default=None, description="replaces the scene's integrator for this view"
    )
    reconstruction: ReconstructionWish | None = Field(
        default=None, description="replaces the top-level reconstruction for this view"
    )

    @property
    def light_after_s(self) -> float:
        """Seconds from a refresh to its light, or that of its first row."""
        return 1.0 / self.refresh_hz if self.display_delay_s is None else self.display_delay_s

    @model_validator(mode="after")
    def _what_has_a_border(self) -> ViewConfig:
        if self.border is not None and self.viewport is None:
            raise refusal("it has no viewport to go around", accepted="a view with viewport", at=("border",))
        return self

    @model_validator(mode="after")
    def _one_field_of_view(self) -> ViewConfig:
        if self.eye is not None and self.camera.fov is not None:
            raise refusal(
                "the eye's place before the wall fixes the field of view already",
                accepted="one of eye, camera.fov",
                at=("camera", "fov"),
            )
        return self


def without_borders(views: tuple[ViewConfig, ...]) -> tuple[ViewConfig, ...]:
    """The same views with no lines around them."""
    return tuple(view.model_copy(update={"border": None}) for view in views)
