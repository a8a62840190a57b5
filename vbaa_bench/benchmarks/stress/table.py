"""The table of a stress test, as text lines."""

from collections.abc import Sequence
from typing import Any, Final

from vbaa_bench.benchmarks.stress.figures import Figure
from vbaa_bench.benchmarks.stress.rows import Targets

Record = dict[str, Any]
TITLE: Final = (
    "answered, consistent, detected, false: % of frames; RMSE, median |error| of x_c: % of L; "
    "ratio: RMS sigma over RMSE; 95 % intervals over rigs"
)
HEADS: Final = (
    "perturbation",
    "frames",
    "answered",
    "RMSE",
    "median",
    "consistent",
    "ratio",
    "detected",
    "false",
    "target",
    "met",
)


def lines(records: Sequence[Record]) -> list[tuple[str, ...]]:
    """Format records as rows of a table under HEADS."""
    return [_line(record) for record in records]


def _line(record: Record) -> tuple[str, ...]:
    targets = _format_targets(Targets(**record["wanted"]))
    name = f"{record['row']}: {record['done']}"
    if "skipped" in record:
        return (name, "0", *["–"] * 7, targets, f"skipped: {record['skipped']}")
    values = {name: Figure(**figure) for name, figure in record["figures"].items()}
    return (
        name,
        str(record["frames"]),
        _format_figure(values["answered"], "{:.0f}"),
        _format_figure(values["rmse"], "{:.3g}"),
        _format_figure(values["median"], "{:.2g}"),
        _format_figure(values["consistent"], "{:.0f}"),
        _format_figure(values["sigma_ratio"], "{:.2g}"),
        _format_figure(values["detected"], "{:.0f}"),
        _format_figure(values["false"], "{:.0f}"),
        targets,
        f"no: {', '.join(record['missed'])}" if record["missed"] else "yes",
    )


def _format_figure(figure: Figure, template: str) -> str:
    if figure.value is None:
        return "–"
    if figure.low is None:
        return template.format(figure.value)
    return f"{template} ({template}–{template})".format(figure.value, figure.low, figure.high)


def _format_targets(targets: Targets) -> str:
    templates = {
        "answered": "answered {:g}",
        "rmse": "RMSE {:g}",
        "consistent": "consistent {:g}",
        "sigma_ratio": "ratio {:g}",
        "detected": "detected {:g}",
        "alarmed": "alarms {:g}",
        "false": "false {:g}",
    }
    return ", ".join(templates[name].format(bound) for name, bound in targets.record().items())
