"""What commands read from a dataset, as a sha256 of their results."""

import functools
import hashlib
import json
import shutil
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Final

from solver.antenna import Antenna
from solver.instrument.observation import open_observations, open_rig_files
from vbaa_bench.dataset.copies import copy_observations
from vbaa_bench.dataset.exr import read_exr
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.report.report import report
from vbaa_bench.scoring.overlay import antenna_of
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import FILES, found_predictions, score


def _digest(parts: Iterable[bytes]) -> str:
    total = hashlib.sha256()
    for part in parts:
        total.update(f"{len(part)} ".encode() + part)
    return total.hexdigest()


def _files(folder: Path, names: Collection[str] = ()) -> Iterable[bytes]:
    """Yield names and contents of all files of a folder, or of those with one of the names."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and (path.name in names or not names):
            yield path.relative_to(folder).as_posix().encode()
            yield path.read_bytes()


def _observations(root: Path) -> str:
    opened = open_observations(root / "observations")
    images = [*opened.read_board_views(), *opened.read_rest_images()]
    images += [frame.image() for frame in opened]
    texts = [repr(opened.rig), *(f"{frame.frame_id} {frame.readings}" for frame in opened)]
    return _digest([*(image.tobytes() for image in images), *(text.encode() for text in texts)])


def _truth(root: Path) -> str:
    opened = open_truth(root / "truth")
    frames = opened.frames.write_json().encode()
    layers = (
        values.tobytes()
        for path in sorted((root / "truth").glob("shard_*/*.exr"))
        for values in read_exr(path).values()
    )
    return _digest([frames, json.dumps(opened.manifest).encode(), *layers])


def _solve(root: Path) -> str:
    """Copy the observations as `solve` does: a method receives nothing else."""
    copy = root.parent / f"{root.name}_for_a_method"
    shutil.rmtree(copy, ignore_errors=True)
    copy_observations(Layout(root), copy)
    return _digest(_files(copy))


@functools.cache
def _antennas() -> dict[str, tuple[Antenna | None, str]]:
    """Return the antennas of this process, by the sha256 of what they are set up from."""
    return {}


def _antenna(results: Results) -> tuple[Antenna | None, str]:
    """Set up the antenna as `report` does: read everything, but compute it once."""
    opened = open_rig_files(results.dataset.observations)
    images = [*opened.read_board_views(), *opened.read_rest_images()]
    key = _digest([repr(opened.rig).encode(), *(image.tobytes() for image in images)])
    if key not in _antennas():
        _antennas()[key] = antenna_of(results)
    return _antennas()[key]


def _report(root: Path) -> str:
    results = Results(root)
    report(results, set_up_antenna=_antenna)
    return _digest(_files(results.report, ("report.html", "overlay.png")))


def _score(root: Path) -> str:
    results = Results(root)
    score(results, found_predictions(results))
    return _digest(_files(results.scores, FILES))


# The report comes first: scoring replaces the scores that it reads.
READERS: Final[dict[str, Callable[[Path], str]]] = {
    "open_observations": _observations,
    "solve": _solve,
    "open_truth": _truth,
    "report": _report,
    "score": _score,
}
