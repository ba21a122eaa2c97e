"""The accumulation of a pixel: running means of the samples that it received while nothing in it moved.

An accumulation image is (h, w, 8) float32. One pixel is half a cache line, since samples arrive in any order.
"""

from __future__ import annotations

RED, GREEN, BLUE = 0, 1, 2  # columns: sum of radiance
COUNT = 3  # samples
BRIGHTNESS_MEAN, BRIGHTNESS_DEVIATIONS = 4, 5  # of the square root of luminance: mean, sum of squared deviations
LIGHTING_MEAN, LIGHTING_DEVIATIONS = 6, 7  # the same of the square root of lighting
COLUMNS = 8
