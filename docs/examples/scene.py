"""Add to a scene in the words of configurations, see a refusal, render: python scene.py [WIDTHxHEIGHT]"""

import sys

import numpy as np
from PIL import Image

import wall
from wall.core.errors import ConfigError

width, height = map(int, (sys.argv[1] if len(sys.argv) > 1 else "480x270").split("x"))
scene = wall.Scene("courtyard")
scene.add_light(type="point", position=(0, 3, 2), intensity=(12, 8, 4))
scene.add_material(type="diffuse", object="column *", color=(0.7, 0.3, 0.2))
scene.set(sky={"zenith": (0.02, 0.03, 0.08), "horizon": (0.1, 0.08, 0.1)})
try:
    scene.add_light(type="point", position=(0, 3, 2), intensity="bright")
except ConfigError as error:
    print(error)  # and the scene is as before

image = wall.render(scene, size=(width, height), samples=4)
Image.fromarray((255 * np.clip(image, 0, 1) ** (1 / 2.2)).astype(np.uint8)).save("evening.png")
