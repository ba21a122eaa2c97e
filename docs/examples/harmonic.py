"""Write a surface with a number at each point, as a file of VTK's, without VTK: python harmonic.py FILE.vtk

A sphere that swings as the spherical harmonic of degree 5 and order 3 says, whose Legendre function is
(1 - x^2)^(3/2) (9 x^2 - 1) but for a factor; Abramowitz and Stegun, chapter 8.
"""

import sys

import numpy as np

AROUND, DOWN = 97, 49  # points of the grid; the last around is where the first is, at the back
turn, fall = np.meshgrid(np.linspace(-np.pi, np.pi, AROUND), np.linspace(0.0, np.pi, DOWN))
x = np.cos(fall)
height = np.sin(fall) ** 3 * (9.0 * x**2 - 1.0) * np.cos(3.0 * turn)
height /= np.abs(height).max()
radius = 1.0 + 0.35 * height
points = np.stack([radius * np.sin(fall) * np.sin(turn), radius * x, radius * np.sin(fall) * np.cos(turn)], axis=-1)

head = "# vtk DataFile Version 3.0\nspherical harmonic 5, 3\nBINARY\nDATASET STRUCTURED_GRID\n"
with open(sys.argv[1] if len(sys.argv) > 1 else "harmonic.vtk", "wb") as file:
    file.write(f"{head}DIMENSIONS {AROUND} {DOWN} 1\nPOINTS {AROUND * DOWN} float\n".encode())
    file.write(points.astype(">f4").tobytes())
    file.write(f"\nPOINT_DATA {AROUND * DOWN}\nSCALARS height float 1\nLOOKUP_TABLE default\n".encode())
    file.write(height.astype(">f4").tobytes() + b"\n")
