"""A saved rig answers as the opened one, and a damaged file is a sentence."""

import contextlib
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import solver
from solver.instrument.errors import InputError
from solver.lab import saved_rig
from tests.draws import generator


@pytest.fixture(scope="module")
def opened(dataset: Path) -> solver.CalibratedRig:
    return solver.open_rig(dataset / "observations")


def same(one: Any, other: Any) -> bool:
    """Whether two trees have the same classes and, bit for bit, the same values."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        equal_kind = one.dtype == other.dtype and one.shape == other.shape
        return equal_kind and bool(one.tobytes() == other.tobytes())
    if dataclasses.is_dataclass(one):
        names = [field.name for field in dataclasses.fields(one)]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    equal: bool = one == other
    return equal


def test_a_saved_rig_is_the_opened_one(
    opened: solver.CalibratedRig, dataset: Path, tmp_path: Path
) -> None:
    opened.save(tmp_path / "rig.npz")
    loaded = solver.load_rig(tmp_path / "rig.npz")
    assert same(opened, loaded)
    trackers = [rig.tracker("push_fit") for rig in (opened, loaded)]
    for frame in solver.open_observations(dataset / "observations"):
        one, other = (
            tracker.solve(frame.image(), frame.readings, frame.push_id).estimate
            for tracker in trackers
        )
        assert one.values == other.values
        assert one.message == other.message


def test_a_saved_rig_in_place_of_a_folder_names_its_function(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is a saved rig, which solver\.load_rig reads"):
        solver.open_rig(tmp_path / "rig.npz")


def test_what_is_no_saved_rig_is_a_sentence(opened: solver.CalibratedRig, tmp_path: Path) -> None:
    path = tmp_path / "rig.npz"
    with pytest.raises(InputError, match=r"none\.npz: is not a saved rig"):
        solver.load_rig(tmp_path / "none.npz")
    path.write_bytes(b"no archive")
    with pytest.raises(InputError, match="is not a saved rig"):
        solver.load_rig(path)
    np.savez(path, other=np.zeros(3))
    with pytest.raises(InputError, match="is not a saved rig"):
        solver.load_rig(path)
    saved_rig.save_tree(path, opened.antenna.rig.beam)
    with pytest.raises(InputError, match="is not a saved rig"):
        solver.load_rig(path)
    opened.save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="is not a saved rig"):
        solver.load_rig(path)
    np.save(path.with_suffix(".npy"), np.zeros(3))
    with pytest.raises(InputError, match="is not a saved rig"):
        solver.load_rig(path.with_suffix(".npy"))
    random = generator(__name__, 1)
    for _ in range(40):
        damaged = bytearray(whole)
        damaged[int(random.integers(len(whole)))] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        # A bit of the archive's times does not matter; any other error fails.
        with contextlib.suppress(InputError):
            solver.load_rig(path)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("solver.api:CalibratedRig", "os:system"),
        ("solver.api:CalibratedRig", "solver.api:open_rig"),
        ("solver.api:CalibratedRig", "solver.api:Path"),
        ("solver.api:CalibratedRig", "solver.__main__:main"),
        ("solver.api:CalibratedRig", "solver.api:Gone"),
        ("solver.api:CalibratedRig", "solver.gone:CalibratedRig"),
        ('"rest_image"', '"image"'),
        ('"array_0"', '"array_x"'),
    ],
)
def test_a_file_of_another_version_is_a_sentence_and_runs_nothing(
    before: str, after: str, opened: solver.CalibratedRig, tmp_path: Path
) -> None:
    path = tmp_path / "rig.npz"
    opened.save(path)
    with np.load(path) as file:
        arrays: dict[str, Any] = {name: file[name] for name in file.files}
    text = str(arrays["tree"])
    assert before in text
    arrays["tree"] = np.array(text.replace(before, after, 1))
    json.loads(str(arrays["tree"]))
    np.savez(path, **arrays)
    with pytest.raises(InputError, match="another version of the antenna, or is damaged"):
        solver.load_rig(path)


def test_what_has_no_plain_fields_is_not_saved(
    opened: solver.CalibratedRig, tmp_path: Path
) -> None:
    own = dataclasses.replace(opened, rest_image=print)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="cannot be saved"):
        own.save(tmp_path / "rig.npz")
    assert not (tmp_path / "rig.npz").exists()
