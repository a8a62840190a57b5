"""The antenna's own software: from images of a bent beam to where, how hard, how sure."""

from pathlib import Path

from solver.instrument.compiled import keep_apart

keep_apart(Path(__file__).parent)

from solver.methods import METHODS  # noqa: E402 - numba is imported only now

__all__ = ["METHODS"]
