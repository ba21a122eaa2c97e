"""Compiled loops that several folders use."""
