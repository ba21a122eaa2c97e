"""Normals and hidden lamps of samples, as compact sample packets carry them. See docs/packet_format.md."""
