"""Scenes from scenes/*.yaml, and the frames they specify, with their random numbers."""
