"""Image sensors: radiance -> exposure -> electrons -> gray values."""
