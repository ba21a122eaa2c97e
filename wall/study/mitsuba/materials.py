"""Materials that Mitsuba lacks, as plugins that evaluate the published formulas inside its integrators.

Nothing of the tracer is used: formulas are written down again in Dr.Jit, and what interfaces reflect in all is
integrated by another quadrature. Plugins of Mitsuba are classes that inherit, made once its variant is known.

`wall_opaque`: a GGX interface over diffuse light, and metal, by metalness and roughness (glTF 2.0): B. Walter et al.,
EGSR 2007; height-correlated shadowing, E. Heitz, JCGT 2014; Schlick's reflectance; light between facets given back
after E. Turquin, 2019; diffuse light gets what the interface leaves.
`wall_walk`: rough glass as a random walk between facets at heights, E. Heitz et al., SIGGRAPH 2016.
`wall_sheet`: a rough sheet of glass (KHR_materials_transmission), which reflects 2 R / (1 + R).
`wall_cutoff`: a texture, 1 where another one reaches a value.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from wall.core.data import Float64

SMOOTHEST = 0.02  # roughness; a smoother interface is perfectly smooth
ROUGHNESSES, COSINES = 50, 100  # of the table of albedos
POINTS = 48  # of its quadrature, along each of two dimensions
SMALLEST_COSINE = 1e-3
MOST_FACETS = 64  # of a walk


@cache
def interface_albedos() -> Float64:
    """(ROUGHNESSES, COSINES, 2) A, B over roughness and cosine, both 0 to 1: A F0 + B F90 of even light is reflected.

    Gauss-Legendre over the projected disc of visible facets' stretched hemisphere (E. Heitz, JCGT 2018), halves apart.
    """
    points, weights = np.polynomial.legendre.leggauss(POINTS)
    radius, turn = 0.5 + 0.5 * points, np.pi * (0.5 + 0.5 * points)  # the other half turn is its mirror image
    weight = np.outer(weights * radius, weights).ravel() / (weights @ radius * weights.sum())
    u, v = np.outer(radius, np.cos(turn)).ravel(), np.outer(radius, np.sin(turn)).ravel()  # u: in the plane of sight
    found = np.empty((ROUGHNESSES, COSINES, 2))
    cosine = np.maximum(np.linspace(0.0, 1.0, COSINES), SMALLEST_COSINE)[:, None]
    sine = np.sqrt(1.0 - cosine**2)
    for k, roughness in enumerate(np.linspace(0.0, 1.0, ROUGHNESSES)):
        alpha = max(roughness, 0.5 * SMOOTHEST) ** 2
        size = np.hypot(alpha * sine, cosine)
        sx, sz = alpha * sine / size, cosine / size
        # the disc seen from (sx, 0, sz): its v axis is whole, its u axis squeezed from the side that lies below
        width = 0.5 * (1.0 + sz)
        across = (1.0 - width) * np.sqrt(1.0 - v**2) + width * u
        out = np.sqrt(np.maximum(1.0 - v**2 - across**2, 0.0))
        hx, hy, hz = alpha * (-sz * across + sx * out), alpha * v, np.maximum(sx * across + sz * out, 0.0)
        size = np.sqrt(hx**2 + hy**2 + hz**2)
        facing = (sine * hx + cosine * hz) / size
        lit = 2.0 * facing * hz / size - cosine
        seen, hidden = _slope_loss(cosine, alpha), _slope_loss(np.maximum(lit, 1e-9), alpha)
        share = np.where(lit > 0.0, (1.0 + seen) / (1.0 + seen + hidden), 0.0) * weight
        grazing = np.clip(1.0 - facing, 0.0, 1.0) ** 5
        found[k] = np.stack([(share * (1.0 - grazing)).sum(axis=1), (share * grazing).sum(axis=1)], axis=-1)
    return found


def _slope_loss(cosine: Float64, alpha: float) -> Float64:
    """Smith's Lambda."""
    return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 - cosine**2) / cosine**2) - 1.0)


@cache
def register(mi: Any) -> None:
    """Makes the plugins known to Mitsuba; mi : the module, its variant chosen, one of Dr.Jit's."""
    import drjit

    dr: Any = drjit

    table = interface_albedos().astype(np.float32)
    columns = [mi.Float(np.ascontiguousarray(table[..., k]).ravel()) for k in range(2)]

    def albedos(cosine: Any, rough: Any) -> tuple[Any, Any]:
        """A and B, bilinear."""
        x, y = dr.clip(cosine, 0.0, 1.0) * (COSINES - 1), dr.clip(rough, SMOOTHEST, 1.0) * (ROUGHNESSES - 1)
        i, j = mi.UInt32(dr.minimum(x, COSINES - 2)), mi.UInt32(dr.minimum(y, ROUGHNESSES - 2))
        fx, fy, at = x - mi.Float(i), y - mi.Float(j), j * COSINES + i
        found = []
        for column in columns:
            a, b, c, d = (dr.gather(mi.Float, column, at + step) for step in (0, 1, COSINES, COSINES + 1))
            found.append(dr.lerp(dr.lerp(a, b, fx), dr.lerp(c, d, fx), fy))
        return found[0], found[1]

    def lost_to_slopes(cosine: Any, alpha: Any) -> Any:
        """Smith's Lambda."""
        return 0.5 * (dr.sqrt(1.0 + dr.square(alpha) * (1.0 / dr.maximum(dr.square(cosine), 1e-12) - 1.0)) - 1.0)

    def facets(alpha: Any) -> Any:
        """Mitsuba's GGX: how normals are distributed, and drawn."""
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True)

    def grown(cosine: Any) -> Any:
        """Schlick's share of the reflectance at grazing angles."""
        return dr.power(dr.clip(1.0 - cosine, 0.0, 1.0), 5)

    class Opaque(mi.BSDF):  # type: ignore[misc]
        """base_color, roughness, metallic : textures; specular, ior : numbers; lit from its front."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            names = "base_color", "roughness", "metallic"
            self.base, self.rough, self.metal = (props.get_texture(name) for name in names)
            self.specular, edge = props["specular"], (props["ior"] - 1.0) / (props["ior"] + 1.0)
            self.plain = self.specular * edge * edge
            lobes = mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection, mi.BSDFFlags.DeltaReflection
            self.m_components = [lobe | mi.BSDFFlags.FrontSide for lobe in lobes]
            self.m_flags = self.m_components[0] | self.m_components[1] | self.m_components[2]

        def look(self, si: Any, active: Any) -> tuple[Any, ...]:
            """Diffuse colour, F0, F90, compensation, roughness."""
            base, rough = self.base.eval(si, active), self.rough.eval_1(si, active)
            metal = dr.clip(self.metal.eval_1(si, active), 0.0, 1.0)
            first, rest = albedos(si.wi.z, rough)
            lost = dr.rcp(first + rest) - 1.0
            coat = (self.plain * first + self.specular * rest) * (1.0 + self.plain * lost)
            shown = (1.0 - metal) * coat + metal * (base * first + rest) * (1.0 + base * lost)
            f0, f90 = dr.lerp(mi.Color3f(self.plain), base, metal), dr.lerp(self.specular, 1.0, metal)
            back = shown / dr.maximum(f0 * first + f90 * rest, 1e-12)
            return base * (1.0 - metal) * (1.0 - coat), f0, f90, back, rough

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            """BSDF times cosine, and the density of `sample` for directions that are not mirrored."""
            active = mi.Mask(active) & (si.wi.z > 0.0) & (wo.z > 0.0)
            diffuse, f0, f90, back, rough = self.look(si, active)
            alpha, half = dr.square(dr.maximum(rough, SMOOTHEST)), dr.normalize(si.wi + wo)
            normals = facets(alpha)
            hidden = 1.0 + lost_to_slopes(si.wi.z, alpha) + lost_to_slopes(wo.z, alpha)
            value = normals.eval(half) / (4.0 * si.wi.z * hidden)
            reflected = value * dr.lerp(f0, mi.Color3f(f90), grown(dr.dot(si.wi, half))) * back
            smooth = rough < SMOOTHEST
            density = normals.pdf(si.wi, half) / (4.0 * dr.maximum(dr.dot(wo, half), 1e-12))
            even = wo.z * dr.inv_pi
            result = diffuse * even + dr.select(smooth, 0.0, reflected)
            density = 0.5 * even + dr.select(smooth, 0.0, 0.5 * density)
            return dr.select(active, result, 0.0), dr.select(active, density, 0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """BSDF times cosine."""
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """The density of `sample`."""
            return self.eval_pdf(ctx, si, wo, active)[1]

        def sample(self, ctx: Any, si: Any, choice: Any, numbers: Any, active: Any = True) -> tuple[Any, Any]:
            """Half of the directions by the cosine, half by visible facets, or mirrored."""
            active, bs = mi.Mask(active) & (si.wi.z > 0.0), mi.BSDFSample3f()
            _, f0, f90, back, rough = self.look(si, active)
            interface, smooth = choice < 0.5, rough < SMOOTHEST
            normal, _ = facets(dr.square(dr.maximum(rough, SMOOTHEST))).sample(si.wi, numbers)
            normal = dr.select(smooth, mi.Normal3f(0.0, 0.0, 1.0), normal)
            bs.wo = dr.select(
                interface, mi.reflect(si.wi, normal), mi.warp.square_to_cosine_hemisphere(numbers)
            )  # fmt: skip
            mirrored = interface & smooth
            value, bs.pdf = self.eval_pdf(ctx, si, bs.wo, active)
            weight = dr.select(bs.pdf > 0.0, value / dr.maximum(bs.pdf, 1e-30), 0.0)
            weight[mirrored] = 2.0 * back * dr.lerp(f0, mi.Color3f(f90), grown(si.wi.z))
            bs.pdf[mirrored] = 0.5
            bs.eta = 1.0
            bs.sampled_component = dr.select(mirrored, mi.UInt32(2), dr.select(interface, mi.UInt32(1), mi.UInt32(0)))
            kinds = (+mi.BSDFFlags.DeltaReflection, +mi.BSDFFlags.GlossyReflection, +mi.BSDFFlags.DiffuseReflection)
            bs.sampled_type = dr.select(
                mirrored, mi.UInt32(kinds[0]), dr.select(interface, mi.UInt32(kinds[1]), mi.UInt32(kinds[2]))
            )  # fmt: skip
            return bs, dr.select(active & (bs.wo.z > 0.0), weight, 0.0)

        def traverse(self, callback: Any) -> None:
            """Nothing is to be changed."""

        def to_string(self) -> str:
            """Its name."""
            return "wall_opaque"

    class Drawn(mi.BSDF):  # type: ignore[misc]
        """color : texture; roughness, ior : numbers. Only drawn, as a mirror is: no direction is aimed at."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            self.color, self.rough, self.ior = props.get_texture("color"), props["roughness"], props["ior"]
            self.alpha = self.rough**2
            both = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [mi.BSDFFlags.DeltaReflection | both, mi.BSDFFlags.DeltaTransmission | both]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            """Nothing."""
            return mi.Color3f(0.0), mi.Float(0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Nothing."""
            return mi.Color3f(0.0)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Nothing."""
            return mi.Float(0.0)

        def traverse(self, callback: Any) -> None:
            """Nothing is to be changed."""

    class Sheet(Drawn):
        """color : of what passes."""

        def sample(self, ctx: Any, si: Any, choice: Any, numbers: Any, active: Any = True) -> tuple[Any, Any]:
            """Mirrored by a visible facet, or that seen through the sheet."""
            bs, side = mi.BSDFSample3f(), dr.mulsign(mi.Float(1.0), si.wi.z)
            wi = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
            normal, _ = facets(mi.Float(self.alpha)).sample(wi, numbers)
            wo = mi.reflect(wi, normal)
            once = mi.fresnel(dr.dot(wi, normal), self.ior)[0]
            first, rest = albedos(wi.z, mi.Float(self.rough))
            seen = 1.0 + lost_to_slopes(wi.z, self.alpha)
            weight = seen / ((seen + lost_to_slopes(wo.z, self.alpha)) * (first + rest))
            back = choice < 2.0 * once / (1.0 + once)
            bs.wo = mi.Vector3f(wo.x, wo.y, side * dr.select(back, wo.z, -wo.z))
            bs.pdf, bs.eta = 1.0, 1.0
            bs.sampled_component = dr.select(back, mi.UInt32(0), mi.UInt32(1))
            kinds = +mi.BSDFFlags.DeltaReflection, +mi.BSDFFlags.DeltaTransmission
            bs.sampled_type = dr.select(back, mi.UInt32(kinds[0]), mi.UInt32(kinds[1]))
            tint = dr.select(back, mi.Color3f(1.0), self.color.eval(si, active))
            return bs, dr.select(mi.Mask(active) & (wo.z > 0.0), tint * weight, 0.0)

        def to_string(self) -> str:
            """Its name."""
            return "wall_sheet"

    def visible(seen: Any, alpha: Any, pair: Any) -> Any:
        """A facet's normal that a direction sees, also from below (E. Heitz and J. Dupuy, 2018; caps: 2023)."""
        to = dr.normalize(mi.Vector3f(alpha * seen.x, alpha * seen.y, seen.z))
        height = dr.fma(1.0 - pair.y, 1.0 + to.z, -to.z)
        sine, cosine = dr.sincos(2.0 * dr.pi * pair.x)
        ring = dr.safe_sqrt(1.0 - dr.square(height))
        normal = mi.Vector3f(ring * cosine + to.x, ring * sine + to.y, height + to.z)
        return dr.normalize(mi.Vector3f(alpha * normal.x, alpha * normal.y, dr.maximum(normal.z, 1e-9)))

    def free_way(z: Any, height: Any, alpha: Any, number: Any) -> Any:
        """The height at which light that goes on from a height meets a facet next; infinite: it leaves.

        Heights of facets are even in [-1, 1]. Light that goes down meets one sooner or later.
        """
        loss = dr.select(z > 0.0, lost_to_slopes(z, alpha), -1.0 - lost_to_slopes(z, alpha))
        loss = dr.select(dr.abs(loss) < 1e-6, 1e-6, loss)
        lower = dr.clip(0.5 * (height + 1.0), 1e-7, 1.0)  # the share of facets below
        leaves = (z > 0.0) & (number > 1.0 - dr.power(lower, loss))
        met = 2.0 * lower / dr.power(dr.maximum(1.0 - number, 1e-7), 1.0 / loss) - 1.0
        return dr.select(leaves, dr.inf, dr.clip(met, -1.0, 1.0))

    class Walk(Drawn):
        """color : of what goes either way."""

        def sample(self, ctx: Any, si: Any, choice: Any, numbers: Any, active: Any = True) -> tuple[Any, Any]:
            """From facet to facet until the light leaves; seen from the side of the index `here` heights are turned."""
            seeds: list[Any] = [dr.reinterpret_array(mi.UInt32, number) for number in (choice, numbers.x, numbers.y)]
            random = mi.PCG32(1, seeds[0] ^ 0x9E3779B9, mi.UInt64(seeds[1]) << 8 | mi.UInt64(seeds[2] >> 8))
            start, alpha = dr.mulsign(mi.Float(1.0), si.wi.z), mi.Float(self.alpha)
            # `way` is turned so that facets lie below it; `behind`: that is in the other medium
            way, height = -mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z)), mi.Float(1.0)
            index = dr.select(start > 0.0, mi.Float(self.ior), 1.0 / self.ior)
            height = free_way(way.z, height, alpha, random.next_float32())

            def meet(way: Any, height: Any, behind: Any, steps: Any, random: Any) -> tuple[Any, ...]:
                pair = mi.Point2f(random.next_float32(), random.next_float32())
                normal, eta = visible(-way, alpha, pair), dr.select(behind, 1.0 / index, index)
                facing = dr.maximum(dr.dot(-way, normal), 1e-7)
                reflected, cosine, _, inverse = mi.fresnel(facing, eta)
                mirrors = random.next_float32() < reflected
                through = inverse * way + (inverse * facing + cosine) * normal
                way = dr.normalize(dr.select(mirrors, way + 2.0 * facing * normal, through))
                way.z = dr.select(mirrors, way.z, -way.z)
                height = free_way(way.z, dr.select(mirrors, height, -height), alpha, random.next_float32())
                return way, height, behind ^ ~mirrors, steps + 1, random

            way, height, behind, _, _ = dr.while_loop(
                (way, height, mi.Bool(False), mi.UInt32(0), random),
                lambda way, height, behind, steps, random: (height < dr.inf) & (steps < MOST_FACETS), meet,
            )  # fmt: skip
            bs = mi.BSDFSample3f()
            bs.wo = mi.Vector3f(way.x, way.y, start * dr.select(behind, -way.z, way.z))
            bs.pdf, bs.eta = 1.0, dr.select(behind, index, 1.0)
            bs.sampled_component = dr.select(behind, mi.UInt32(1), mi.UInt32(0))
            kinds = +mi.BSDFFlags.DeltaReflection, +mi.BSDFFlags.DeltaTransmission
            bs.sampled_type = dr.select(behind, mi.UInt32(kinds[1]), mi.UInt32(kinds[0]))
            weight = self.color.eval(si, active) * dr.select(behind, dr.square(1.0 / index), 1.0)
            return bs, dr.select(mi.Mask(active) & (way.z > 0.0), weight, 0.0)

        def to_string(self) -> str:
            """Its name."""
            return "wall_walk"

    class Cutoff(mi.Texture):  # type: ignore[misc]
        """values : texture; 1 where it is at least `least`."""

        def __init__(self, props: Any) -> None:
            mi.Texture.__init__(self, props)
            self.values, self.least = props.get_texture("values"), props["least"]

        def eval_1(self, si: Any, active: Any = True) -> Any:
            """1 or 0."""
            return dr.select(self.values.eval_1(si, active) >= self.least, mi.Float(1.0), mi.Float(0.0))

        def eval(self, si: Any, active: Any = True) -> Any:
            """The same as a colour."""
            return mi.Color3f(self.eval_1(si, active))

        def is_spatially_varying(self) -> bool:
            """Yes."""
            return True

        def traverse(self, callback: Any) -> None:
            """Nothing is to be changed."""

        def to_string(self) -> str:
            """Its name."""
            return "wall_cutoff"

    mi.register_bsdf("wall_opaque", Opaque)
    mi.register_bsdf("wall_sheet", Sheet)
    mi.register_bsdf("wall_walk", Walk)
    mi.register_texture("wall_cutoff", Cutoff)
