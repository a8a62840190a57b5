"""The reference kernel, and its column in the predictions of a method."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vbaa_bench.dataset.layout import Layout
from vbaa_bench.scoring import reference_kernel
from vbaa_bench.scoring.child import solve


def test_the_kernel_does_a_fixed_amount_of_work() -> None:
    image = np.array([[2, 4], [6, 8]], dtype=np.uint8)
    sums = reference_kernel._kernel(image, 0)
    assert sums == pytest.approx([5.0, 6.0])
    # The recurrence v = sqrt(2 + v) ends at 2, slightly damped.
    assert reference_kernel._kernel(image, 50)[0] == pytest.approx(4.0 + 2.0, abs=1e-3)


def test_every_frame_has_a_reference_time(dataset: Path, tmp_path: Path) -> None:
    solve(Layout(dataset), "exact_fit", tmp_path / "exact_fit.csv", 1)
    times = pl.read_csv(tmp_path / "exact_fit.csv")["reference_ms"]
    assert len(times) == 4
    assert (times > 0).all()
