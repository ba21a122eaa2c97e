"""Render a built-in scene from two places, and write what a screen shows: python render.py [WIDTHxHEIGHT]"""

import sys

import numpy as np
from PIL import Image

import wall

width, height = map(int, (sys.argv[1] if len(sys.argv) > 1 else "480x270").split("x"))
scene = wall.Scene("courtyard")
cameras = [
    {"position": (7.4, 3.6, 9.4), "target": (0, 0.9, 0), "fov": 38},
    {"position": (-3, 1.6, 6), "target": (0, 1.2, 0), "fov": 50},
]
images = [wall.render(scene, camera=camera, size=(width, height), samples=4) for camera in cameras]

linear = np.concatenate(images)  # float32, linear RGB: two images, one above the other
shown = np.clip(linear, 0, 1) ** (1 / 2.2)
Image.fromarray((255 * shown).astype(np.uint8)).save("courtyard.png")
