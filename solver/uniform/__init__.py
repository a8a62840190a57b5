"""Fit of the uniform beam's closed form to one frame, compiled: the fast road of `exact_fit`."""
