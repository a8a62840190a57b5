"""The sentence at the head of the report: which method errs least, and which is fastest."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from markupsafe import Markup

from solver.instrument.arrays import Floats
from vbaa_bench.regression.compared import LEAST_RELATIVE_CHANGE_OF_TIME
from vbaa_bench.report.method_statistics import MethodStatistics
from vbaa_bench.report.numbers import short
from vbaa_bench.scoring.ranking import FEWEST_GROUPS, ranks

# Chosen: a method that leaves out the hardest tenth of the frames is still comparable.
_NEARLY = 0.9


def summary(methods: Collection[MethodStatistics]) -> Markup:
    """Name the most accurate and the fastest of the methods that answer nearly all they could.

    These are methods with at least 90 % of the answers of the method that has most. Several are
    named where they cannot be distinguished, see `scoring.ranking`. Only times that `solve`
    measured beside the reference kernel are compared.
    """
    most = max((one.answered for one in methods), default=0)
    complete = [
        one for one in methods if one.median is not None and one.answered >= _NEARLY * most > 0
    ]
    if not complete:
        return Markup("No method estimates x_c.")
    if len(complete) > 1 and all(np.isnan(one.median_draws).all() for one in complete):
        return Markup("Methods are not compared: there are fewer than {} pushes, or rigs.").format(
            FEWEST_GROUPS
        )
    best = _first({one.method: one.median_draws for one in complete})
    accurate = [one for one in complete if one.method in best]
    text = Markup("Most accurate: {}, with {} of <b>{} % of L</b>.").format(
        _named(accurate),
        "a median error" if len(accurate) == 1 else "median errors",
        _span([one.median for one in accurate]),
    )
    timed = {one.method: one.time_draws for one in complete if not np.isnan(one.time_draws).all()}
    if timed:
        quick = _first(timed, LEAST_RELATIVE_CHANGE_OF_TIME)
        fastest = [one for one in complete if one.method in quick]
        speed = Markup("<b>{} ms</b> per frame").format(_span([one.ms for one in fastest]))
        text += (
            Markup(" It is also the fastest: {}.").format(speed)
            if quick == best and len(best) == 1
            else Markup(" Fastest: {}, {}, {} % of L.").format(
                _named(fastest), speed, _span([one.median for one in fastest])
            )
        )
    return text


def _first(draws: Mapping[str, Floats], margin: float = 0.0) -> list[str]:
    """List the methods of rank 1."""
    return [name for name, rank in ranks(draws, margin).items() if rank == 1]


def _named(methods: Sequence[MethodStatistics]) -> Markup:
    """Join the names of methods, of which several cannot be distinguished."""
    names = [Markup("<b>{}</b>").format(one.method) for one in methods]
    if len(names) == 1:
        return names[0]
    listed = Markup(", ").join(names[:-1])
    return Markup("{} and {}, which cannot be distinguished").format(listed, names[-1])


def _span(values: Sequence[float | None]) -> str:
    """Format the smallest and the largest of some numbers, or the one that both are."""
    numbers = [value for value in values if value is not None]
    low, high = short(min(numbers, default=None)), short(max(numbers, default=None))
    return low if low == high else f"{low} to {high}"
