"""Track of real sets: estimates of real images, compared with what balance and ruler know.

The record real/NAME.json of a suite's folder has the digest of the set NAME, and the scores of
every method that was run on it. Methods run in this process, without limits of time and memory.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

from solver.instrument.errors import InputError
from solver.instrument.files import write_text
from solver.lab.findings import findings
from solver.lab.protocol import Load, Protocol, check_protocol
from solver.lab.protocol_score import Score, compare, scores, solve_known
from solver.methods import LEARNING, METHODS, Method
from solver.set_up import set_up
from vbaa_bench.dataset.document import Document, check_document, read_json
from vbaa_bench.dataset.lock import writing
from vbaa_bench.scoring.isolation.runs import applicable
from vbaa_bench.suite.folder import SuiteFolder

# The method of the weights; all others solve the pushes.
_OF_WEIGHTS: Final = "hung_weight"


class MethodScore(NamedTuple):
    """Score of a method for one quantity of a set."""

    method: str
    score: Score


class ScoredSet(NamedTuple):
    """Scores on a set, sorted by load, quantity and error; `sha256` is the digest of the set."""

    name: str
    sha256: str
    scores: list[MethodScore]

    def by_quantity(self) -> list[list[MethodScore]]:
        """Group the scores by load and quantity, of which the set knows the values."""
        groups = groupby(self.scores, key=lambda one: (one.score.load, one.score.quantity))
        return [list(group) for _, group in groups]


class _Record(Document):
    sha256: str
    methods: dict[str, list[Score]]


@dataclass(frozen=True)
class OpenedSet:
    """A complete set, its digest, and the path of its record."""

    root: Path
    protocol: Protocol
    sha256: str
    record: Path

    def methods(self, requested: Sequence[str], on_line: Callable[[str], None]) -> list[str]:
        """List the methods of its pushes: those of `requested`, or all that apply to its images.

        hung_weight solves the weights. `on_line` receives remarks on methods that are left out.
        """
        for name in requested:
            if name in LEARNING:
                on_line(f"{self.root}: {name} is left out: a real set has no pushes to learn from")
        names = requested or applicable(self.protocol.observations)
        return [name for name in names if name != _OF_WEIGHTS and name not in LEARNING]

    def stored(self) -> dict[str, list[Score]]:
        """Read the scores in its record. Raises InputError if they are those of another set."""
        if not self.record.is_file():
            return {}
        record = _read(self.record)
        if record.sha256 != self.sha256:
            raise InputError(
                f"{self.root}: differs from the set that {self.record} was made from; rename the "
                "folder, or delete that file"
            )
        return record.methods

    def score(self, methods: Mapping[str, Method], on_line: Callable[[str], None]) -> None:
        """Run methods, by name, on the pushes, and hung_weight on the weights; store the scores.

        The scores of other methods are kept. `on_line` receives remarks. Raises InputError.
        """
        stored = self.stored()
        antenna = set_up(self.protocol.observations)
        for finding in findings(antenna):
            on_line(f"{self.root}: {finding.message}")
        for name, method in {**methods, _OF_WEIGHTS: METHODS[_OF_WEIGHTS]}.items():
            on_line(f"{self.root}: solving with {name}")
            load: Load = "weight" if name == _OF_WEIGHTS else "push"
            comparisons = [
                one
                for known, estimate in solve_known(self.protocol, antenna, load, method)
                for one in compare(known, estimate, antenna.rig)
            ]
            stored[name] = scores(comparisons, antenna.rig)
        document = {
            "sha256": self.sha256,
            "methods": {name: [one._asdict() for one in of] for name, of in stored.items()},
        }
        with writing(self.record.parent):
            self.record.parent.mkdir(exist_ok=True)
            write_text(self.record, json.dumps(document, indent=1) + "\n")


def open_set(folder: SuiteFolder, root: Path) -> OpenedSet:
    """Open a set for the folder of a suite.

    Raises InputError if it is incomplete, if the suite has no such track, and as `stored` does.
    """
    if folder.suite.content.real is None:
        raise InputError(
            f"{folder.suite.path}: has no track real, allowed are sets in one that has"
        )
    protocol, missing = check_protocol(root)
    if protocol is None or missing:
        raise InputError(
            f"{root}: is no complete set; python -m solver check --protocol {root} lists what is "
            "missing or wrong"
        )
    opened = OpenedSet(
        root, protocol, protocol.digest(), folder.real / f"{root.resolve().name}.json"
    )
    opened.stored()
    return opened


def scored_sets(folder: SuiteFolder) -> list[ScoredSet]:
    """Read the scores of all sets in the folder of a suite, by name. Raises InputError."""
    sets = []
    for path in sorted(folder.real.glob("*.json")):
        record = _read(path)
        of_methods = [
            MethodScore(name, score) for name, found in record.methods.items() for score in found
        ]
        sets.append(ScoredSet(path.stem, record.sha256, sorted(of_methods, key=_order)))
    return sets


def _read(path: Path) -> _Record:
    return check_document(path, read_json(path), _Record)


def _order(one: MethodScore) -> tuple[str, str, float, str]:
    error = one.score.error_pct
    return (one.score.load, one.score.quantity, math.inf if error is None else error, one.method)
