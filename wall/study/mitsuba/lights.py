"""Lights that Mitsuba lacks, as plugins: classes that inherit, made once its variant is known.

`wall_spot`: a spot that fades as glTF's do (KHR_lights_punctual). `wall_sun`: a disc far away that no ray meets.
`wall_lamp`: a surface that shines on both sides.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any


@cache
def register(mi: Any) -> None:
    """Makes the plugins known to Mitsuba; mi : the module, its variant chosen, one of Dr.Jit's."""
    import drjit

    dr: Any = drjit

    class Far(mi.Emitter):  # type: ignore[misc]
        """What spots and suns share: no ray meets them."""

        def __init__(self, props: Any) -> None:
            mi.Emitter.__init__(self, props)
            self.m_flags = +mi.EmitterFlags.DeltaPosition

        def eval(self, si: Any, active: Any = True) -> Any:
            """Nothing."""
            return mi.Color3f(0.0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            """Nothing."""
            return mi.Float(0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            """Nothing."""
            return mi.Color3f(0.0)

        def found(self, it: Any, point: Any, normal: Any, weight: Any, active: Any) -> tuple[Any, Any]:
            """The sample of a point that shines."""
            ds = dr.zeros(mi.DirectionSample3f)
            ds.p, ds.n, ds.time, ds.pdf, ds.delta = mi.Point3f(point), mi.Normal3f(normal), it.time, 1.0, True
            ds.d = ds.p - it.p
            ds.dist = dr.norm(ds.d)
            ds.d = ds.d / ds.dist
            ds.emitter = mi.EmitterPtr(self)
            return ds, dr.select(active, weight, 0.0)

        def bbox(self) -> Any:
            """None of its own."""
            return mi.ScalarBoundingBox3f()

        def traverse(self, callback: Any) -> None:
            """Nothing is to be changed."""

    class Spot(Far):
        """position, direction : points; intensity : texture; scale, offset : of the cosine, as in glTF."""

        def __init__(self, props: Any) -> None:
            Far.__init__(self, props)
            self.position, self.direction = mi.Point3f(props["position"]), mi.Vector3f(props["direction"])
            self.intensity, self.scale, self.offset = mi.Color3f(props["intensity"]), props["scale"], props["offset"]

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            """The only one."""
            way = it.p - self.position
            square = dr.squared_norm(way)
            share = dr.clip(self.scale * dr.dot(way, self.direction) * dr.rsqrt(square) + self.offset, 0.0, 1.0)
            return self.found(it, self.position, self.direction, self.intensity * dr.square(share) / square, active)

        def to_string(self) -> str:
            """Its name."""
            return "wall_spot"

    class Sun(Far):
        """direction : towards it; irradiance : of what faces it; angle : half its diameter; reach : how far."""

        def __init__(self, props: Any) -> None:
            Far.__init__(self, props)
            self.frame, self.irradiance = mi.Frame3f(mi.Vector3f(props["direction"])), mi.Color3f(props["irradiance"])
            self.least, self.reach = math.cos(props["angle"]), props["reach"]

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            """Even over its solid angle; its radiance is the irradiance over pi sine^2."""
            way = self.frame.to_world(mi.warp.square_to_uniform_cone(sample, self.least))
            weight = self.irradiance * (2.0 * (1.0 - self.least) / (1.0 - self.least**2))
            return self.found(it, it.p + self.reach * way, -way, weight, active)

        def to_string(self) -> str:
            """Its name."""
            return "wall_sun"

    class Lamp(mi.Emitter):  # type: ignore[misc]
        """radiance : texture."""

        def __init__(self, props: Any) -> None:
            mi.Emitter.__init__(self, props)
            self.radiance = props.get_emissive_texture("radiance")
            self.m_flags = +mi.EmitterFlags.Surface

        def eval(self, si: Any, active: Any = True) -> Any:
            """What is seen of it."""
            return dr.select(active, self.radiance.eval(si, active), 0.0)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            """Even over its surface."""
            ds = self.get_shape().sample_direction(it, sample, active)
            active = mi.Mask(active) & (ds.pdf > 0.0)
            si = mi.SurfaceInteraction3f(ds, it.wavelengths)
            ds.emitter = mi.EmitterPtr(self)
            return ds, dr.select(active, self.radiance.eval(si, active) / dr.maximum(ds.pdf, 1e-30), 0.0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            """Of sample_direction, by solid angle."""
            return self.get_shape().pdf_direction(it, ds, active)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            """What is seen of it."""
            return dr.select(active, self.radiance.eval(mi.SurfaceInteraction3f(ds, it.wavelengths), active), 0.0)

        def bbox(self) -> Any:
            """Its shape's."""
            return self.get_shape().bbox()

        def traverse(self, callback: Any) -> None:
            """Nothing is to be changed."""

        def to_string(self) -> str:
            """Its name."""
            return "wall_lamp"

    mi.register_emitter("wall_spot", Spot)
    mi.register_emitter("wall_sun", Sun)
    mi.register_emitter("wall_lamp", Lamp)
