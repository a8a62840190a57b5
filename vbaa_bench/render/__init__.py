"""Meshes, light and camera -> radiance and truth layers. The only room that imports Mitsuba."""
