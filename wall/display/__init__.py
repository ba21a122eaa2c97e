"""Where an image ends: PNG files, a recorded sequence, a page in the browser."""
