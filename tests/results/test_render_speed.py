import itertools
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from results.render_speed import __main__ as command
from results.render_speed import image_error
from results.render_speed import measure as measuring
from results.render_speed.curves import at_equal_error
from results.render_speed.image_error import Line
from results.render_speed.measure import measure
from solver.instrument.errors import InputError
from vbaa_bench.dataset.target import FAST
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.scene.load import load_scene

SCENE = """
title: A stretch of the beam in a small image
seed: 3
camera:
  width_px: 96
  height_px: 40
  focal_length_px: 700
  position_mm: [100.0, 8.0, 360.0]
  look_at_mm: [100.2, 8.0, 0.0]
  tip_in_view: false
calibration: {columns: 6, rows: 3, square_mm: 3, center_mm: [100.0, 8.0]}
pushes: {contact_distance_mm: [110], deflection_pct: [10]}
"""


def curve(power: float, errors: list[float]) -> list[dict[str, Any]]:
    """Seconds that grow as a power of the error, and are one at an error of 1 %."""
    return [{"rmse_over_peak": e, "seconds": (e / 0.01) ** power} for e in errors]


def test_seconds_at_equal_error_are_read_off_a_power_law() -> None:
    inside = at_equal_error(curve(-2, [0.04, 0.02, 0.004]), 0.005)
    assert inside == {"seconds": pytest.approx(4), "extrapolated": False}
    beyond = at_equal_error(curve(-1.3, [0.1, 0.05, 0.03, 0.02]), 0.005)
    assert beyond == {"seconds": pytest.approx(2**1.3), "extrapolated": True}
    before = at_equal_error(curve(-2, [0.002, 0.001]), 0.005)
    assert before == {"seconds": pytest.approx(4), "extrapolated": True}


def test_a_centroid_is_that_of_the_light_above_the_ground_and_of_no_hidden_column() -> None:
    rows, height, width = np.linspace(19.6, 22.3, 12), 40, 12
    away = np.abs(np.arange(height)[:, None] - rows)
    image = 0.3 + np.clip(1.5 - away, 0, 1)
    image[:, 5] = 0.3
    found = Line(rows, 4).centroids(image, image)
    assert np.isnan(found[5])
    # A trapezoid's samples tell its middle to a few hundredths of a pixel.
    assert np.abs(found - rows)[np.arange(width) != 5].max() < 0.1
    moved = Line(rows, 4).centroids(np.roll(image, 1, axis=0), image) - found
    assert np.allclose(moved[~np.isnan(moved)], 1)


def test_a_scenes_folder_stays_free_for_its_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[Path] = []

    def measured(_file: object, _variant: str, _seconds: float, out: Path) -> dict[str, Any]:
        written.append(out)
        raise InputError("measured enough")

    monkeypatch.setattr(command, "measure", measured)
    monkeypatch.setattr(command, "choose", str)
    path = tmp_path / "small.yaml"
    path.write_text(SCENE, encoding="utf-8")
    CliRunner().invoke(command.app, [str(path)])
    assert written
    dataset = Path("runs/small")
    assert dataset != written[0]
    assert dataset not in written[0].parents
    with pytest.raises(InputError, match="cannot be written"):
        measure(load_scene(path), FAST, 1, path / "below_a_file")


def test_a_frame_of_both_says_its_seconds_and_its_error(
    variant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if variant == PLAIN:
        pytest.skip("it compiles no kernels")
    # Each look at the clock takes 0.05 s, so that the machine's speed does not choose the work.
    clock = itertools.count(0, 0.05).__next__
    monkeypatch.setattr(measuring, "perf_counter", clock)
    monkeypatch.setattr(image_error, "perf_counter", clock)
    path = tmp_path / "small.yaml"
    path.write_text(SCENE, encoding="utf-8")
    record = measure(load_scene(path), variant, 2.0, tmp_path / "out")
    assert set(record["curves"]) == {"ours", "independent", "multijitter"}
    for points in record["curves"].values():
        errors = [point["rmse_over_peak"] for point in points]
        assert len(errors) >= 2
        assert errors[-1] < errors[0]
        assert all(point["seconds"] > 0 for point in points)
        assert all(point["centreline_rmse_px"] > 0 for point in points)
    assert record["reference_noise_over_peak"] < record["rmse_over_peak"] / 3
    # A little noise is in the reference too.
    assert record["rmse_over_peak"] < record["curves"]["multijitter"][0]["rmse_over_peak"]
    for key in ("seconds_over_rays", "speedup_at_equal_rmse", "frames_per_s"):
        assert 0 < record[key] < np.inf
    assert all(share > 0 for share in record["kernel_share"].values())
    table = pl.read_csv(tmp_path / "out" / "render_speed.csv")
    assert len(table) == sum(map(len, record["curves"].values()))
    assert (tmp_path / "out" / "render_speed.png").read_bytes().startswith(b"\x89PNG")


def test_what_plain_mitsuba_cannot_render_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "blurred.yaml"
    path.write_text(SCENE + "optics: {point_spread_px: 0.5}\n", encoding="utf-8")
    with pytest.raises(InputError, match="point_spread_px"):
        measure(load_scene(path), "llvm_ad_mono", 1.0, tmp_path)
    with pytest.raises(InputError, match=PLAIN):
        measure(load_scene(path), PLAIN, 1.0, tmp_path)
