"""Learning the beam and its clamp: shape from pushes, EI from a weight or a known force."""
