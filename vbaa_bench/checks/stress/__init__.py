"""What ordinary cameras and laboratories do wrong, and what the solver makes of it."""
