"""Compiled loops of the graph's executor: framelet reprojection (timewarp)."""
