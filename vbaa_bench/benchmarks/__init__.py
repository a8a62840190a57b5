"""Measurements of methods: speed, stability, errors under disturbances and their causes; leaks."""
