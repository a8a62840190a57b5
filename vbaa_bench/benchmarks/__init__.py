"""Measurements of the project itself: speed, stability, ordinary cameras, contact sheets."""
