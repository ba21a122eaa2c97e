"""Stored samples: the deep buffer that is reprojected, and the newest sample of each pixel."""
