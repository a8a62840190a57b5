"""Information limits: the smallest variance that any unbiased method can reach in a frame."""
