"""Outline of an unknown object, from contacts at many poses of the antenna."""
