"""Scenes made by code: courtyard, forest, gallery, museum and smaller ones."""
