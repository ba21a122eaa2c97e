"""`wall measure peers`: other programs draw the same triangles while the camera moves, on the same cores."""
