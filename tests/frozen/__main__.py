"""Compare this version's answers with the frozen ones, or freeze them:

    python -m tests.frozen                      # exit status 1 if too many differ
    python -m tests.frozen --freeze DATASET...  # of all frames of these datasets and collections

The frozen measurements are those of the version that froze them, of the datasets that
tests/frozen/datasets.sh makes.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from rich.progress import track

from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.observation import open_observations
from solver.instrument.units import MILLIMETRE
from solver.set_up import set_up
from solver.tracker import PushTracker
from tests.frozen import answers, measurements
from tests.frozen.compared import compared, passes, truths_of
from tests.frozen.measurements import Frame
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth

DATA: Final = Path(__file__).parents[1] / "data" / "frozen"
_SHOWN: Final = 30


def main() -> int:
    """Compare or freeze; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.frozen", description=__doc__)
    parser.add_argument("--freeze", nargs="+", type=Path, metavar="DATASET")
    stated = parser.parse_args()
    if stated.freeze:
        freeze(stated.freeze)
        return 0
    frames = measurements.load(DATA)
    old = answers.load(DATA / "answers.npz")
    new = dict(track(answers.answers(frames), "answering", len(old)))
    results = compared(old, new, truths_of(frames))
    for one in results:
        before, after = (100 * rms for rms in one.rmse)
        print(
            f"{one.solver:18} {one.answered:5} answers, {len(one.differ):4} differ; values up to "
            f"{one.value_sigma:.2g} sigma, sigmas up to {100 * one.sigma:.2g} %; "
            f"RMSE of x_c {before:.4g} -> {after:.4g} % of L"
        )
    for difference in [one for result in results for one in result.differ][:_SHOWN]:
        print(f"  {difference.question}: {difference.how}")
    return 0 if passes(results) else 1


def freeze(roots: Sequence[Path]) -> None:
    """Measure all frames of datasets, and store them with this version's answers."""
    DATA.mkdir(parents=True, exist_ok=True)
    frames: list[Frame] = []
    rigs: dict[str, str] = {}
    for root in (path for given in roots for path in _datasets(given)):
        name = "_".join(root.parts[-2:] if root.name.startswith("rig_") else root.parts[-1:])
        try:
            found = list(_measured(root, name, len(frames)))
        except InputError as error:  # a rig that its rest images refuse
            print(f"{name}: {error}", flush=True)
            continue
        if found:
            rigs[name] = (Layout(root).observations / "rig.json").read_text("utf-8")
            frames += found
        print(f"{name}: {len(found)} frames", flush=True)
    measurements.save(DATA, frames, rigs)
    # What is frozen is the answer to what is stored, in few bytes.
    stored = measurements.load(DATA)
    given = dict(track(answers.answers(stored), "answering"))
    answers.save(DATA / "answers.npz", given)


def _datasets(root: Path) -> list[Path]:
    return sorted(path.parent.parent for path in root.rglob("observations/rig.json"))


def _measured(root: Path, name: str, first: int) -> Iterator[Frame]:
    """Yield the frames of a dataset in which a beam was measured; `first` is their first number."""
    layout = Layout(root)
    observations = open_observations(layout.observations)
    rows = {row["frame_id"]: row for row in open_truth(layout.truth).frames.to_dicts()}
    kept: list[Measurement] = []

    def keep(measurement: Measurement) -> Estimate:
        kept.append(measurement)
        return Estimate(Outcome.INVALID, "measured")

    tracker = PushTracker(set_up(observations), keep)
    pushes: dict[str, list[int]] = {}
    for frame in observations:
        before = len(kept)
        tracker.solve(frame.image(), frame.readings, frame.push_id)
        if len(kept) == before:
            continue
        row, earlier = rows[frame.frame_id], pushes.setdefault(frame.push_id, [])
        x_c = None if row["x_c_mm"] is None else row["x_c_mm"] * MILLIMETRE
        yield Frame(frame.frame_id, name, frame.push_id, x_c, kept[-1], tuple(earlier))
        earlier.append(first + before)


if __name__ == "__main__":
    sys.exit(main())
