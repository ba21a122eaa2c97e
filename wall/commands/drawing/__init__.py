"""A configuration as a drawing: the wall to scale, and its compositing graph."""
