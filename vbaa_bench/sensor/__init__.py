"""Radiance -> exposure -> electrons -> gray values."""
