"""Scenes made by code: courtyard, forest and gallery."""
