"""Outlines of objects from pushes all around them, scored against their meshes."""
