"""Photographs of one beam from several poses, without a board."""
