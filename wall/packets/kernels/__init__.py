"""Compiled loops that pack samples into bytes and read them back."""
