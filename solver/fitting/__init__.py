"""Least squares with the exact beam: one frame (compiled), one push, and the outcome of a fit."""
