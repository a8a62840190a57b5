"""Least squares: residual terms, priors and one Gauss-Newton."""
