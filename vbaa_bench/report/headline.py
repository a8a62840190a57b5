"""The sentence at the head of the report: which method errs least, and which is fastest."""

from collections.abc import Collection

from markupsafe import Markup

from vbaa_bench.report.method_statistics import MethodStatistics
from vbaa_bench.report.numbers import short

# Chosen: a method that leaves out the hardest tenth of the frames is still comparable.
_NEARLY = 0.9


def summary(methods: Collection[MethodStatistics]) -> Markup:
    """Name the most accurate and the fastest of the methods that answer nearly all they could.

    These are methods with at least 90 % of the answers of the method that has most.
    """
    most = max((one.answered for one in methods), default=0)
    complete = [
        one for one in methods if one.median is not None and one.answered >= _NEARLY * most > 0
    ]
    if not complete:
        return Markup("No method estimates x_c.")
    best = min(complete, key=lambda one: one.median or 0.0)
    text = Markup("Most accurate: <b>{}</b>, with a median error of <b>{} % of L</b>.").format(
        best.method, short(best.median)
    )
    timed = [one for one in complete if one.ms]
    if timed:
        fastest = min(timed, key=lambda one: one.ms or 0.0)
        speed = Markup("<b>{} ms</b> per frame").format(short(fastest.ms))
        text += (
            Markup(" It is also the fastest: {}.").format(speed)
            if (fastest is best)
            else Markup(" Fastest: <b>{}</b>, {}, {} % of L.").format(
                fastest.method, speed, short(fastest.median)
            )
        )
    return text
