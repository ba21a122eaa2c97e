"""wall: a parallel, sort-first, frameless ray-traced renderer for tiled display walls."""
