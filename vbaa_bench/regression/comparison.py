"""Comparison of scored runs with their baselines: which results changed, and are they worse?"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np

from solver.instrument.errors import InputError
from vbaa_bench.dataset.collection import is_collection
from vbaa_bench.regression.baseline import check_same_scene, read_baseline
from vbaa_bench.regression.cells import Cell, PairedScene, cells, change_table
from vbaa_bench.regression.compared import TIME, ComparedQuantity
from vbaa_bench.regression.permutation_test import FALSE_ALARM, permutation_test
from vbaa_bench.regression.scored_run import ScoredRun, pair, read_run
from vbaa_bench.scoring.strata import ALL

Verdict = Literal["worse", "better", "not distinguishable", "same"]
# Share of the false alarms for times, whose noise is of another kind. Chosen: a method 1.3 times as
# slow is far above the threshold, while nine pushes can just pass that of the other results.
_SHARE_OF_TIMES: Final = 0.2
# Swaps are drawn from a fixed seed, so that a comparison can be repeated.
_SEED: Final = 0


class RunAndBaseline(NamedTuple):
    """Folder of a scored run, and the baseline file with which it is compared."""

    run: Path
    baseline: Path


@dataclass(frozen=True)
class Change:
    """Change of a method's quantity in one stratum of one scene.

    `old` and `new` are typical values in `unit`: geometric means of the pushes' root mean squares,
    or mean rates. `p` is the probability that any cell of an unchanged table changes as much.
    `smallest` is the smallest change, in `unit`, that would have been reported: one that all pushes
    have in common, added to their scatter; None if none would have been.

    `verdict` is "worse" or "better" if the change is significant and not below the smallest change
    that matters; "same" if such a change would have been reported, or if no push changed by as
    much; otherwise "not distinguishable": the pushes are too few, or scatter too much.
    """

    scene: str
    method: str
    quantity: str
    unit: str
    stratum: str
    pushes: int
    frames: int
    old: float
    new: float
    p: float
    smallest: float | None
    verdict: Verdict


@dataclass(frozen=True)
class Comparison:
    """Table of changes, and notes on what could not be compared."""

    changes: tuple[Change, ...]
    notes: tuple[str, ...]

    @property
    def worse(self) -> list[Change]:
        """The changes for the worse."""
        return [change for change in self.changes if change.verdict == "worse"]

    @property
    def better(self) -> list[Change]:
        """The changes for the better."""
        return [change for change in self.changes if change.verdict == "better"]

    @property
    def not_distinguishable(self) -> list[Change]:
        """The results that are not distinguishable."""
        return [change for change in self.changes if change.verdict == "not distinguishable"]

    @property
    def unresolved(self) -> list[Change]:
        """The results that are not distinguishable, those of all frames only."""
        return [change for change in self.not_distinguishable if change.stratum == ALL]

    @property
    def reported(self) -> list[Change]:
        """What a reader must see: what changed, and what could not be resolved."""
        return [*self.worse, *self.better, *self.unresolved]

    @property
    def sentence(self) -> str:
        """The number of results that were compared, and of each verdict."""
        counts = Counter(change.verdict for change in self.changes)
        listed = ", ".join(f"{counts[verdict]} {verdict}" for verdict in get_args(Verdict))
        return f"{len(self.changes)} results compared: {listed}"

    def records(self) -> list[dict[str, Any]]:
        """Convert the changes to records of plain values, for JSON and tables."""
        return [asdict(change) for change in self.changes]


def pairs_of(run: Path, baseline: Path) -> list[RunAndBaseline]:
    """Pair a run with its baseline file, or the runs in a folder with the baselines in a folder.

    A folder's baselines are paired by name: NAME.json with the run NAME. Raises InputError if no
    baseline has a run.
    """
    if not baseline.is_dir():
        return [RunAndBaseline(run, baseline)]
    pairs = [RunAndBaseline(run / path.stem, path) for path in sorted(baseline.glob("*.json"))]
    existing = [one for one in pairs if one.run.is_dir()]
    if not existing:
        raise InputError(f"{baseline}: no baseline in this folder has a run in {run}")
    return existing


def compare(pairs: Sequence[RunAndBaseline]) -> Comparison:
    """Compare scored runs with their baselines, as one table with one rate of false alarms.

    A change is reported if it is significant, see `permutation_test`, and not below the tolerance
    of its quantity, see `compared`. Raises InputError if nothing can be compared.
    """
    scenes, notes = dict[str, PairedScene](), list[str]()
    for run, path in pairs:
        old, new = read_baseline(path).run, read_run(run)
        check_same_scene(old, new, path)
        scene = PairedScene(
            path.stem,
            pair(old, new, path),
            same_images=old.images == new.images,
            same_processor=old.processor == new.processor,
            rigs=is_collection(run),
        )
        scenes[path.stem] = scene
        notes += _notes(scene, old, new)
    return table(scenes, notes, [str(path) for _, path in pairs])


def table(
    scenes: dict[str, PairedScene], notes: Sequence[str] = (), sources: Sequence[str] = ()
) -> Comparison:
    """Test all cells of paired scenes together. Raises InputError if there is no cell.

    The message names the `sources`, by default the scenes.
    """
    listed = cells(scenes)
    if not listed:
        raise InputError(
            f"{', '.join(sources or scenes)}: nothing can be compared, every set of paired frames "
            "has fewer than nine pushes"
        )
    times = [cell for cell in listed if cell.quantity is TIME]
    others = [cell for cell in listed if cell.quantity is not TIME]
    found = _tested(others, 1 - _SHARE_OF_TIMES) + _tested(times, _SHARE_OF_TIMES)
    return Comparison(tuple(found), tuple(notes))


def _tested(listed: list[Cell], share: float) -> list[Change]:
    """Test cells together, with a share of the false alarms of the whole table."""
    if not listed:
        return []
    tested = permutation_test(
        change_table(listed), share * FALSE_ALARM, np.random.default_rng(_SEED)
    )
    return [
        _change(cell, min(float(p) / share, 1.0), float(smallest))
        for cell, p, smallest in zip(listed, *tested, strict=True)
    ]


def _change(cell: Cell, p: float, smallest: float) -> Change:
    quantity = cell.quantity
    old, new = quantity.of_set(cell.old), quantity.of_set(cell.new)
    least = _least_change(quantity, old)
    smallest = _in_unit(quantity, smallest, old)
    verdict: Verdict
    if p <= FALSE_ALARM and abs(new - old) >= least:
        verdict = "worse" if (new > old) == quantity.larger_is_worse else "better"
    elif min(smallest, _in_unit(quantity, np.abs(cell.new - cell.old).max(), old)) <= least:
        verdict = "same"
    else:
        verdict = "not distinguishable"
    return Change(
        scene=cell.scene,
        method=cell.method,
        quantity=quantity.label,
        unit=quantity.unit,
        stratum=cell.stratum,
        pushes=len(cell.units),
        frames=cell.frames,
        old=old,
        new=new,
        p=p,
        smallest=max(smallest, least) if smallest < np.inf else None,
        verdict=verdict,
    )


def _in_unit(quantity: ComparedQuantity, change: float, old: float) -> float:
    """Convert a change on the scale of `of_push` to one of `old`, in a quantity's unit."""
    if quantity.kind == "rate":
        return change
    return old * float(np.expm1(min(change, 100.0))) if change < np.inf else np.inf


def _least_change(quantity: ComparedQuantity, old: float) -> float:
    """Compute the smallest change that matters, in the unit of a quantity."""
    if quantity.kind == "rate":
        return quantity.tolerance
    return max(quantity.tolerance, quantity.least_relative * old)


def _notes(scene: PairedScene, old: ScoredRun, new: ScoredRun) -> list[str]:
    notes = [
        f"{scene.name}: {method} was not run" for method in old.methods if method not in new.methods
    ]
    notes += [
        f"{scene.name}: {method} is not in the baseline"
        for method in new.methods
        if method not in old.methods
    ]
    places = ["rig", "trial"]
    paired, known = (rows.select(places).unique().height for rows in (scene.frames, old.frames))
    if paired < known:
        notes.append(f"{scene.name}: {known - paired} of {known} frames have no partner")
    if not scene.same_images:
        notes.append(f"{scene.name}: the images are others than those of the baseline")
    if not scene.same_processor:
        notes.append(f"{scene.name}: times were not compared, the processor is another one")
    return notes
