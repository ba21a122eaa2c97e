"""Measures speed and image quality. Nothing imports it but the command line."""
