"""Rendering: meshes, lights and camera -> radiance and truth layers. Only here is Mitsuba used."""
