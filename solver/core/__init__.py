"""Least squares: one loop for all fits, its normal equations, and weights for outliers."""
