"""Beam + object + motion -> equilibrium: the world's own beam, by integration alone."""
