"""Report on a set of real images with known loads: what is missing, and how the solver answers."""

import json
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from solver.instrument.errors import InputError
from solver.instrument.observation import tables_beside
from solver.lab.file_findings import file_findings
from solver.lab.findings import Finding, findings
from solver.lab.protocol import check_protocol
from solver.lab.protocol_score import (
    USUAL_METHODS,
    Comparison,
    Score,
    compare,
    mistakes,
    scores,
    solve_known,
)
from solver.set_up import set_up


@dataclass(frozen=True)
class ProtocolReport:
    """What is missing or wrong in a set, and its loads as they are known and as estimated."""

    findings: tuple[Finding, ...]
    comparisons: tuple[Comparison, ...] = ()
    scores: tuple[Score, ...] = ()

    def json(self) -> str:
        """Format as one line of JSON."""
        document = {
            "findings": [one._asdict() for one in self.findings],
            "scores": [one._asdict() for one in self.scores],
            "comparisons": [
                {**one._asdict(), "deviation": one.deviation} for one in self.comparisons
            ],
        }
        return json.dumps(document)

    def text(self) -> str:
        """List every finding, one per line."""
        if not self.findings:
            return "complete: nothing is missing, and nothing contradicts balance and ruler"
        return "\n".join(f"- {one.message}" for one in self.findings)

    def tables(self) -> tuple[Table, Table]:
        """Make the table of all loads, estimated against known, and that of the scores."""
        loads = Table("image", "load", "", "known", "estimated", "deviation, sigmas")
        for one in self.comparisons:
            loads.add_row(
                one.file_name,
                one.load,
                one.quantity,
                f"{one.known:.4g} +- {one.known_sigma:.2g}",
                f"{_text(one.estimated, '.4g')} +- {_text(one.estimated_sigma, '.2g')}",
                _text(one.deviation, "+.1f"),
            )
        summary = Table(
            *("load", "", "n", "answered, %", "median error, %", "known to, %"),
            *("RMS, sigmas", "within 3 sigma, %"),
        )
        for score in self.scores:
            summary.add_row(
                score.load,
                score.quantity,
                str(score.n_loads),
                f"{score.answered_pct:.0f}",
                _text(score.error_pct, ".2g"),
                f"{score.known_pct:.2g}",
                _text(score.rms_deviation, ".2f"),
                _text(score.within_3_sigma_pct, ".0f"),
            )
        return loads, summary


def _text(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def protocol_report(folder: Path) -> ProtocolReport:
    """Check a set, solve its images, and compare the estimates with balance and ruler."""
    protocol, missing = check_protocol(folder)
    if protocol is None:
        return ProtocolReport(tuple(missing))
    try:
        antenna = set_up(protocol.observations)
    except InputError as error:
        return ProtocolReport((*missing, Finding("no_calibration", str(error))))
    answers = [
        answer
        for load, method in USUAL_METHODS.items()
        for answer in solve_known(protocol, antenna, load, method)
    ]
    comparisons = [one for answer in answers for one in compare(*answer, antenna.rig)]
    of_files = file_findings(protocol.observations, tables_beside(folder))
    contradicted = (*of_files, *findings(antenna), *mistakes(answers, comparisons))
    return ProtocolReport(
        (*missing, *contradicted), tuple(comparisons), tuple(scores(comparisons, antenna.rig))
    )
