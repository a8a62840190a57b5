"""Beam + object + motion -> equilibrium: the world's own beam, integrated, never solved in closed form."""
