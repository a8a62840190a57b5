"""The fuzz: run cases of all kinds, keep the findings, and continue an interrupted run.

OUT/
  material/              valid inputs, see material.py
  cases.jsonl            seed, then one line per case: kind, number, outcome, s, MB, text
  findings/KIND_NUMBER/  the input of every finding, and its text in finding.txt
"""

import json
import shutil
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from solver.instrument.errors import InputError
from tests.robustness.fuzz.case import ALLOWED, FINDINGS, OUTCOMES, Case, Result
from tests.robustness.fuzz.kinds import KINDS
from tests.robustness.fuzz.pool import run_all
from vbaa_bench.scoring.tables import markdown_table

# Called with a kind, and the number of its finished cases.
Progress = Callable[[str, int], None]


def fuzz(
    counts: Mapping[str, int],
    seed: int,
    material: Path,
    out: Path,
    workers: int,
    progress: Progress = lambda _kind, _done: None,
) -> dict[str, Any]:
    """Run `counts` cases of each kind; return the record of `summary`.

    The cases are functions of `seed` and of the files in `material`. Finished cases in `out` are
    not run again. Raises InputError if `out` has the cases of another seed.
    """
    out.mkdir(parents=True, exist_ok=True)
    findings, work = out / "findings", out / "work"
    results = _finished(out / "cases.jsonl", seed)
    shutil.rmtree(work, ignore_errors=True)
    finished = Counter(case.kind for case in results)
    for kind, done in finished.items():
        progress(kind, done)

    def keep(case: Case, folder: Path) -> None:
        target = findings / f"{case.kind}_{case.number}"
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(folder, target, symlinks=True)

    cases = (case for case in _cases(counts) if case not in results)
    factories = {kind: KINDS[kind] for kind, count in counts.items() if count}
    try:
        with (out / "cases.jsonl").open("a", encoding="utf-8") as stream:
            for case, result in run_all(cases, factories, seed, material, work, workers, keep):
                results[case] = result
                stream.write(json.dumps([*case, *result]) + "\n")
                stream.flush()
                if result.outcome in FINDINGS:
                    path = findings / f"{case.kind}_{case.number}" / "finding.txt"
                    path.write_text(f"{result.outcome}\n{result.text}\n", encoding="utf-8")
                finished[case.kind] += 1
                progress(case.kind, finished[case.kind])
    finally:
        shutil.rmtree(work, ignore_errors=True)
    chosen = set(_cases(counts))
    return summary(seed, {case: result for case, result in results.items() if case in chosen})


def _cases(counts: Mapping[str, int]) -> list[Case]:
    """List the cases; kinds take turns, so that an interrupted run has cases of all."""
    cases = [Case(kind, number) for kind, count in counts.items() for number in range(count)]
    return sorted(cases, key=lambda case: case.number / counts[case.kind])


def _finished(path: Path, seed: int) -> dict[Case, Result]:
    """Read the finished cases of an interrupted run, or begin its file with the seed."""
    if not path.exists():
        path.write_text(json.dumps({"seed": seed}) + "\n", encoding="utf-8")
        return {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    try:
        recorded = json.loads(lines[0])["seed"]
        # A line without its end is of an interrupted write.
        whole = [line for line in lines[1:] if line.endswith("\n")]
        results = {Case(*row[:2]): Result(*row[2:]) for row in map(json.loads, whole)}
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"{path}: is not the list of cases of a fuzz; delete it") from error
    if recorded != seed:
        raise InputError(f"{path}: is of seed {recorded}; choose another folder with --out")
    path.write_text("".join([lines[0], *whole]), encoding="utf-8")
    return results


def summary(seed: int, results: Mapping[Case, Result]) -> dict[str, Any]:
    """Summarise the results by kind: counts by outcome, slowest case, largest memory, findings."""
    kinds: dict[str, Any] = {}
    for kind in KINDS:
        rows = {case.number: result for case, result in results.items() if case.kind == kind}
        if rows:
            slowest = max(rows, key=lambda number: rows[number].seconds)
            largest = max(rows, key=lambda number: rows[number].memory_mb)
            counts = Counter(result.outcome for result in rows.values())
            kinds[kind] = {
                "cases": len(rows),
                "outcomes": {name: counts[name] for name in OUTCOMES if counts[name]},
                "slowest_s": round(rows[slowest].seconds, 2),
                "slowest_case": slowest,
                "largest_mb": round(rows[largest].memory_mb),
                "largest_case": largest,
                "findings": sorted(n for n, row in rows.items() if row.outcome not in ALLOWED),
            }
    return {
        "seed": seed,
        "cases": len(results),
        "findings": sum(len(kind["findings"]) for kind in kinds.values()),
        "kinds": kinds,
    }


HEADS: Final = (
    *("input", "cases", "accepted", "refused", "noisy", "findings", "slowest, s", "memory, MB"),
)


def rows(record: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Format a summary as the rows of a table."""
    return [
        (
            kind,
            str(values["cases"]),
            *(str(values["outcomes"].get(name, 0)) for name in ALLOWED),
            _findings(values["outcomes"]),
            f"{values['slowest_s']:.1f}",
            str(values["largest_mb"]),
        )
        for kind, values in record["kinds"].items()
    ]


def _findings(outcomes: Mapping[str, int]) -> str:
    parts = [f"{outcomes[name]} {name}" for name in FINDINGS if name in outcomes]
    return ", ".join(parts) or "0"


def markdown(record: Mapping[str, Any]) -> str:
    """Format a summary as a table in Markdown, with its seed."""
    table = markdown_table(HEADS, rows(record))
    return f"Seed {record['seed']}, {record['cases']} cases:\n\n{table}\n"
