"""Compiled loops of the compositing operators."""
