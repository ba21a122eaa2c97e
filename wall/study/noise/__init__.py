"""`wall measure noise`: how fast the noise of paths falls, and what a denoiser makes of it."""
