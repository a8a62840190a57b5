"""What a frame shows: the plan of the pushes, their experiments, bodies and meshes, and motion."""
