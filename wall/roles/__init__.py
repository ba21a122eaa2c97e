"""Decides what manager, renderers and compositors do with messages and time."""
