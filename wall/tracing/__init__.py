"""Rays in, samples out: Embree traversal, shading, shadow rays."""
