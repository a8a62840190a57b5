"""Splits: whole pushes or rigs, filled evenly, kept when a set grows."""

from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from solver.instrument.errors import InputError
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.sampling import SplitSpec

HALVES = SplitSpec(shares={"learn": 0.5, "test": 0.5})


@given(seed=st.integers(0, 2**63 - 1), pushes=st.integers(1, 200))
def test_halves_differ_by_at_most_one_push_from_even_numbers(seed: int, pushes: int) -> None:
    counts = Counter(HALVES.name(seed, number) for number in range(2 * pushes))
    assert counts["learn"] == counts["test"] == pushes


def test_shares_are_those_of_the_scene() -> None:
    spec = SplitSpec(shares={"train": 0.8, "val": 0.1, "test": 0.1})
    counts = Counter(spec.name(5, number) for number in range(1000))
    for name, share in spec.shares.items():
        assert counts[name] == pytest.approx(1000 * share, abs=4)


def test_shares_add_up_to_one() -> None:
    with pytest.raises(ValidationError, match=r"shares add up to 0\.9, allowed is 1"):
        SplitSpec(shares={"train": 0.9})


def test_a_rig_is_in_one_split(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    text = (
        "title: Splits\nseed: 4\nrigs: 40\n"
        "pushes: {contact_distance_mm: [100], deflection_pct: [5], repeats: 3}\n"
        "splits: {by: rig, shares: {train: 0.75, test: 0.25}}\n"
    )
    path.write_text(text, encoding="utf-8")
    file = load_scene(path)
    names = []
    for number in range(40):
        splits = file.rig(number).scene.splits
        assert splits is not None
        names += list(splits.shares)
    assert Counter(names) == {"train": 30, "test": 10}
    path.write_text(text.replace("0.25", "0.5"), encoding="utf-8")
    with pytest.raises(InputError, match=r"shares add up to 1\.25"):
        load_scene(path)
