"""The picture of reprojected samples on a GPU, by OpenGL 4.3."""
