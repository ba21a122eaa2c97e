"""Geometry: panels in the wall's frame, cameras in the world, and the rays that join them."""
