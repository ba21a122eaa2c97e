"""Data of measurements and simulations as objects of a scene: loaded only where a scene has such."""
