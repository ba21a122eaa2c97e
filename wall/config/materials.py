"""Models of `scene.materials:` and `scene.integrator:`: what surfaces look like, and how light is followed."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from wall.core.fields import (
    LARGEST_IOR,
    SMALLEST_IOR,
    Color,
    Depth,
    Flag,
    Model,
    Number,
    Positive,
    Reflectance,
    Share,
    Text,
    check_one_named,
    refusal,
)

Ior = Annotated[Number, Ge(SMALLEST_IOR), Le(LARGEST_IOR)]


class _OfSurfaces(Model):
    object: Text | None = Field(default=None, description="name of the object, or a pattern with * and ?")
    material: Text | None = Field(default=None, description="name of the source's material, or a pattern with * and ?")

    @model_validator(mode="after")
    def _one_target(self) -> _OfSurfaces:
        check_one_named("object", self.object, "material", self.material)
        return self


class _Coloured(_OfSurfaces):
    color: Reflectance | None = Field(
        default=None, description="linear RGB reflectance, 0..1; absent = the source's own"
    )
    texture: Text | None = Field(
        default=None,
        description="image file, .png or .jpg, put on by the mesh's texture coordinates; its colours are multiplied by "
        "`color`, absent = white",
    )


class DiffuseConfig(_Coloured):
    """A matt surface."""

    type: Literal["diffuse"] = Field(description="light goes equally in all directions")


class PlasticConfig(_Coloured):
    """A coat over a matt surface."""

    type: Literal["plastic"] = Field(description="a clear coat over a diffuse surface")
    roughness: Share = Field(default=0.3, description="of the coat; 0 = smooth")
    ior: Ior = Field(default=1.5, description="index of refraction of the coat")


class MetalConfig(_Coloured):
    """Metal, smooth or rough."""

    type: Literal["metal"] = Field(description="reflects in its colour")
    roughness: Share = Field(default=0.3, description="0 = polished")


class AttenuationConfig(Model):
    """What glass absorbs."""

    color: Reflectance = Field(description="linear RGB, what is left of white light after the distance, 0..1")
    distance: Positive = Field(description="of way inside, world units")


class GlassConfig(_Coloured):
    """Glass, smooth or frosted; the order of its triangles' corners says where the outside is."""

    type: Literal["glass"] = Field(
        description="reflects and refracts; the mesh should be closed, its corners counterclockwise from outside"
    )
    roughness: Share = Field(default=0.0, description="0 = clear")
    ior: Ior = Field(default=1.5, description="index of refraction")
    thin: Flag = Field(default=False, description="a sheet: light goes straight on, and the mesh need not be closed")
    attenuation: AttenuationConfig | None = Field(
        default=None, description="what it absorbs inside, by the way that light goes there; absent = nothing"
    )

    @model_validator(mode="after")
    def _has_an_inside(self) -> GlassConfig:
        if self.thin and self.attenuation is not None:
            raise refusal("thin glass has no inside", accepted="color, or thin: false", at=("attenuation",))
        return self


class MirrorConfig(_OfSurfaces):
    """A perfect mirror."""

    type: Literal["mirror"] = Field(description="mirrors without colour or loss")
    share: Share = Field(default=1.0, description="of the light; the rest is as in the source")


class EmissionConfig(_OfSurfaces):
    """A surface that shines."""

    type: Literal["emission"] = Field(description="a light source with an area")
    radiance: Color = Field(description="linear RGB, W sr^-1 m^-2")
    sides: Literal["both", "front"] = Field(
        default="both", description="front: only where a triangle's corners go counterclockwise"
    )


MaterialConfig = Annotated[
    DiffuseConfig | PlasticConfig | MetalConfig | GlassConfig | MirrorConfig | EmissionConfig,
    Field(discriminator="type"),
]


class DirectConfig(Model):
    """Light straight from lights and sky, and in mirrors."""

    method: Literal["direct"] = Field(default="direct", description="direct light, shadows, mirrors; no noise")


class PathConfig(Model):
    """Light over several surfaces."""

    method: Literal["path"] = Field(description="path tracing: indirect light, metal, glass, lights with an area")
    depth: Depth = Field(default=6, description="most surfaces that scatter a path")


class AmbientOcclusionConfig(Model):
    """An even white light that only hides behind what is near."""

    method: Literal["ambient_occlusion"] = Field(description="even light that what is near hides; no lights")
    distance: Positive = Field(default=2.0, description="as far as surfaces hide light, world units")
    colors: Flag = Field(default=True, description="surfaces have their colours; false = all are white")


IntegratorConfig = Annotated[DirectConfig | PathConfig | AmbientOcclusionConfig, Field(discriminator="method")]
