"""Assembly of a frame: the mechanical experiment, its bodies and meshes, and their motion."""
