"""Render layers beside the image, and use them: edges of objects over their albedo. python layers.py [WIDTHxHEIGHT]"""

import sys

import numpy as np
from PIL import Image

import wall

width, height = map(int, (sys.argv[1] if len(sys.argv) > 1 else "480x270").split("x"))
layers = wall.render("courtyard", size=(width, height), samples=4, layers=["albedo", "normal", "depth", "object_id"])

of = layers["object_id"]  # (height, width) uint32; 0 is the sky
edges = np.zeros(of.shape, bool)
edges[:, 1:] |= of[:, 1:] != of[:, :-1]
edges[1:] |= of[1:] != of[:-1]
near = np.nanmin(layers["depth"])
print(f"{len(np.unique(of)) - 1} objects, the nearest point is {near:.2f} away")

drawing = layers["albedo"] * (0.6 + 0.4 * layers["normal"][:, :, 1:2])  # brighter where it faces up
drawing[edges] = 0
Image.fromarray((255 * np.clip(drawing, 0, 1) ** (1 / 2.2)).astype(np.uint8)).save("drawing.png")
