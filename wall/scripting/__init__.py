"""`wall` from Python: scenes, offline images, and walls in the background. `import wall` gives all three."""
