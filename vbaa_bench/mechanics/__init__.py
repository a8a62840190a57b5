"""Equilibrium of a beam pushed against objects; the exact beam is solved by integration only."""
