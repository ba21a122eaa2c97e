"""Compiled loops over tiles of images that displays get."""
