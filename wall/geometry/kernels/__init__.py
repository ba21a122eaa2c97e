"""Compiled loops of geometry: the walk along a Hilbert curve."""
