"""Compiled loops of the ray tracer: packets of 16 rays, surfaces, direct light."""
