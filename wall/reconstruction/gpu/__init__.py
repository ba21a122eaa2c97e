"""Reconstruction on a GPU, by OpenGL 4.3."""
