"""Answers of the antenna that were frozen once, and with which each version is compared."""
