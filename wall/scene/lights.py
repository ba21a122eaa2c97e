"""Light for models that bring none: a key light from above the viewer's shoulder and a soft grey-blue studio.

The tracer's radiance of a diffuse surface is albedo (E_light cos / pi + E_sky / pi), shown as sRGB clipped at 1.
With the values below a surface of albedo 0.8 gets, from the sky alone, 0.8 * 0.30 where it faces up (display 0.53)
and 0.8 * 0.18 where it faces down (0.42); facing the key light squarely it gets at most 0.8 * (0.75 + 0.30) = 0.84
(display 0.93, nothing blown out), and turned 60 degrees away about 0.8 * (0.375 + 0.29) = 0.53 (0.75).
"""

from __future__ import annotations

import math

from wall.scene.model import DirectionalLight, Sky

KEY_DIRECTION = (0.45, 0.75, 0.48)       # right, above, towards a viewer who looks along -z
KEY_SHARE = (0.78, 0.75, 0.69)           # irradiance / pi: slightly warm against the cool sky

STUDIO_SKY = Sky(zenith=(0.27, 0.29, 0.33), horizon=(0.34, 0.36, 0.39), ground=(0.11, 0.105, 0.10))


def default_lights() -> tuple[DirectionalLight, ...]:
    """The key light alone; the studio sky fills the shadows. The world's up is +y."""
    length = math.hypot(*KEY_DIRECTION)
    x, y, z = (part / length for part in KEY_DIRECTION)
    r, g, b = (math.pi * share for share in KEY_SHARE)
    return (DirectionalLight(direction=(x, y, z), irradiance=(r, g, b)),)
