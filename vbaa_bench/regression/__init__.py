"""Comparison of a scored run with a baseline: what changed, and is it worse?"""
