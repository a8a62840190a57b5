"""A short fuzz of the kinds of input that need no scored dataset; the command has all."""

import gc
import shutil
from collections import Counter
from pathlib import Path

import pytest

from tests.robustness.fuzz.case import ALLOWED, Case
from tests.robustness.fuzz.child import Runner
from tests.robustness.fuzz.kinds import KINDS

SCENES = Path(__file__).parents[3] / "scenes"


@pytest.fixture(scope="module")
def material(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The part of the command's material that these kinds need."""
    folder = tmp_path_factory.mktemp("material")
    shutil.copytree(SCENES, folder / "scenes")
    (folder / "files").mkdir()
    shutil.copy(SCENES / "objects" / "hexagon.stl", folder / "files")
    shutil.copytree(dataset, folder / "dataset")
    # Garbage is collected after each case: what the tests before this left is not searched again.
    gc.collect()
    gc.freeze()
    return folder


# One odd setting in fifty is accepted: the seeds are those of which one is.
@pytest.mark.parametrize(
    ("kind", "seed", "count"), [("scenes", 2, 12), ("images", 2, 16), ("settings", 3, 20)]
)
def test_mistakes_are_refused(
    kind: str, seed: int, count: int, material: Path, tmp_path: Path
) -> None:
    runner = Runner({kind: KINDS[kind]}, seed, material, tmp_path / "work")
    outcomes: Counter[str] = Counter()
    for number in range(count):
        result = runner.run(Case(kind, number))
        assert result.outcome in ALLOWED, f"{kind} {number}: {result.text}"
        outcomes[result.outcome] += 1
    # Mistakes are made, and not all inputs are beyond use.
    assert outcomes["refused"]
    assert outcomes["accepted"]
