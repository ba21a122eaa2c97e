"""Kernels of images that surround a scene: read by the tracer, and by layers that show the sky alone."""
