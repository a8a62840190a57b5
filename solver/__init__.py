"""The antenna's own software: from images of a bent beam to where, how hard, how sure."""

from solver.methods import METHODS

__all__ = ["METHODS"]
