"""Beam physics of the solver: closed forms that relate a shape to contact and force."""
