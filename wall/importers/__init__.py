"""Converts other systems' wall descriptions to configurations."""
