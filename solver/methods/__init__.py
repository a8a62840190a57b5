"""The methods, one a file: a measurement in, an estimate out."""

from collections.abc import Callable
from typing import Final

from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit
from solver.methods.two_point import two_point

Method = Callable[[Measurement], Estimate]

METHODS: Final[dict[str, Method]] = {"two_point": two_point, "exact_fit": exact_fit}
