"""Tracing of a beam's centreline in one photograph, from marks of its clamp and its tip."""
