"""Scenes from scenes/*.yaml, and their trials: the frames to simulate, with random numbers."""
