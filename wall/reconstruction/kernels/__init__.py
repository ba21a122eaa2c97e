"""Compiled loops of reconstruction: visibility, splatting, hole filling, relighting. Arrays in, counts out."""
