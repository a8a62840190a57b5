"""Checks of a machine and of a rig, rather than of a method."""
