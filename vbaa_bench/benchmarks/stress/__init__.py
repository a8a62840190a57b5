"""Stress test: the solver's results under common errors of cameras and laboratories."""
