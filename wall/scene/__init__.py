"""What is rendered: meshes, materials, lights, sky, and how they move."""
