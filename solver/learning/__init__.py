"""Learning the beam and its clamp from pushes against unknown objects."""
