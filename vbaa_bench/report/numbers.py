"""Numbers as text: two or three significant digits, never in powers of ten."""

import math

import numpy as np


def short(value: float | None, digits: int = 2) -> str:
    """Format a number with so many significant digits; a dash if it is missing."""
    if value is None or not math.isfinite(value):
        return "–"
    if abs(value) >= 10**digits:
        return f"{value:.0f}"
    text = np.format_float_positional(value, digits, fractional=False, trim="-")
    return text.replace("-", "\N{MINUS SIGN}")


def signed(value: float | None, digits: int = 2) -> str:
    """Format a number with its sign."""
    return f"+{short(value, digits)}" if value is not None and value > 0 else short(value, digits)


def percent(fraction: float | None) -> str:
    """Format a fraction as a percentage; 100 only if all cases count, 0 only if none does."""
    if fraction is None or not math.isfinite(fraction):
        return "–"
    if 0.99 < fraction < 1:
        return f"{math.floor(1000 * fraction) / 10:g}"
    if 0 < fraction < 0.1:
        return short(100 * fraction)
    return f"{100 * fraction:.0f}"
