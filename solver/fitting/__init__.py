"""Least squares with the exact beam: of one frame, compiled; of a push; what is said of a fit."""
