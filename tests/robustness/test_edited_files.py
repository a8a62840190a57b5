"""A few random edits of files that a scene names; edited_files.py is the command for many."""

from pathlib import Path

import numpy as np

from tests.robustness.edited_files import REFUSED, SAME, SITUATIONS, run_trials


def test_no_edit_of_a_file_is_mixed_in_silently(
    tmp_path: Path, variant: str, random: np.random.Generator
) -> None:
    seed = int(random.integers(2**32))
    trials = list(run_trials(len(SITUATIONS), seed, variant, tmp_path))
    assert {trial.situation for trial in trials} == set(SITUATIONS)
    assert [trial for trial in trials if trial.outcome not in (SAME, REFUSED)] == []
