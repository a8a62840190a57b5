"""One sentence per method: accuracy, speed, share answered, coverage and efficiency."""

from collections.abc import Collection

from markupsafe import Markup, escape

from vbaa_bench.report.method_statistics import MethodStatistics
from vbaa_bench.report.numbers import percent, short
from vbaa_bench.scoring.information_sets import SETS

# Chosen: with 300 frames a method with right intervals is outside of these in 1 of 1,000 reports.
_TOO_NARROW, _TOO_WIDE = 0.90, 0.99
# Chosen: a method that leaves out the hardest tenth of the frames is still comparable.
_NEARLY = 0.9
# Chosen: smaller efficiencies differ in nothing that matters.
_LEAST = 0.001


def headline(one: MethodStatistics) -> Markup:
    """Write the sentence of a method, without its name; figures are in <b>."""
    clauses = [_accuracy(one), _share(one), _coverage(one), _efficiency(one)]
    text = Markup("; ").join(clause for clause in clauses if clause)
    return _unbroken(Markup(text + "."))


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


def _unbroken(text: Markup) -> Markup:
    """Keep numbers and their units in one line."""
    for unit in ("%", "ms"):
        text = text.replace(f" {unit}", f"\N{NO-BREAK SPACE}{unit}")
    return text


def _accuracy(one: MethodStatistics) -> Markup:
    time = Markup(" in <b>{} ms</b>").format(short(one.ms)) if one.ms else Markup(", not timed")
    if one.median is not None:
        return Markup("errs by <b>{} % of L</b>{}").format(short(one.median), time)
    if one.force_rmse is not None:
        return Markup("estimates force only, RMSE <b>{} %</b>{}").format(
            short(one.force_rmse), time
        )
    return Markup("estimates no contact") if one.contacts else Markup("answers{}").format(time)


def _share(one: MethodStatistics) -> Markup:
    parts = []
    if one.contacts:
        refused = f", rightly refuses {percent(one.right_refusals / one.contacts)} %"
        share = percent(one.share_answered)
        parts.append(f"answers {share} %{refused if one.right_refusals else ''}")
    if one.free:
        parts.append(f"{one.false_contacts} false contacts in {one.free} free frames")
    return escape("; ".join(parts))


def _coverage(one: MethodStatistics) -> Markup:
    share = one.coverage_95
    if share is None:
        return Markup("states no uncertainty" if one.answered else "")
    verdict = " (too narrow)" if share < _TOO_NARROW else " (too wide)" if share > _TOO_WIDE else ""
    return escape(f"{percent(share)} % of its 95 % intervals contain the truth{verdict}")


def _efficiency(one: MethodStatistics) -> Markup:
    if one.efficiency is None or one.information is None:
        return Markup("")
    where = SETS[one.information]
    share = "less than 0.1" if one.efficiency < _LEAST else percent(one.efficiency)
    return Markup("uses <b>{} %</b> of the information in {}").format(share, where)
