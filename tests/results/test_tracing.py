"""Reference lines, baseline and scores of tracing, on drawn cables of known centreline."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial import cKDTree

from results.tracing.__main__ import app
from results.tracing.cables import stretches
from results.tracing.measure import cases, figures, ridge_score, trace_score
from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.lab.command_end import run_command
from tests.command_line import CommandLine
from tests.draws import generator

SHAPE = (240, 420)
WIDTH = 11.0


def line_of(bend: float, height: float) -> Floats:
    """A curved line (n, 2) [px] across the image."""
    u = np.arange(20.0, 400.0, 0.25)
    return np.column_stack([u, height + bend * np.sin(u / 90)])


def label_of(lines: list[Floats]) -> npt.NDArray[np.uint8]:
    """Labels 1, 2, ... of lines; later ones cover earlier ones."""
    labels = np.zeros(SHAPE, np.uint8)
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]]
    pixels = np.column_stack([u.ravel(), v.ravel()])
    for number, line in enumerate(lines, 1):
        labels[(cKDTree(line).query(pixels)[0] < WIDTH / 2).reshape(SHAPE)] = number
    return labels


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """One image with one cable, in the layout of mBEST."""
    line = line_of(25.0, 120.0)
    labels = label_of([line])
    soft = cv2.GaussianBlur((labels > 0).astype(np.float32), (0, 0), 1.0)[..., None]
    image = 10 + soft * (np.array([60.0, 70.0, 160.0]) - 10)
    image += 2 * generator(__name__, 1).standard_normal(image.shape)
    for folder in ("images", "gt_labels"):
        (tmp_path / "S1" / folder).mkdir(parents=True)
    cv2.imwrite(str(tmp_path / "S1/images/img0.jpg"), np.clip(np.rint(image), 0, 255))
    np.save(tmp_path / "S1/gt_labels/img0.npy", labels)
    return tmp_path


def test_the_reference_is_the_middle_of_a_label() -> None:
    line = line_of(25.0, 120.0)
    (stretch,) = stretches(label_of([line]), 1)
    off = cKDTree(line).query(stretch.line)[0]
    assert np.sqrt(np.mean(off**2)) < 0.2
    assert stretch.visible.mean() > 0.95
    assert len(stretch.line) > 300


def test_a_cable_that_is_crossed_is_one_with_a_gap() -> None:
    crossing = np.column_stack([np.linspace(180, 240, 900), np.linspace(20, 220, 900)])
    labels = label_of([line_of(10.0, 120.0), crossing])
    (stretch,) = stretches(labels, 1)
    assert not stretch.visible.all()
    assert len(stretch.line) > 300


def test_traced_points_and_a_ridge_are_scored(dataset: Path) -> None:
    every = list(cases(dataset, odd=False))
    traced = figures(trace_score(case) for case in every)
    ridge = figures(ridge_score(case) for case in every)
    assert traced["stretches"] == ridge["stretches"] == 1
    assert traced["refused"] == 0
    assert traced["coverage_pct"] > 90
    # A label of whole pixels is not better.
    assert traced["median_px"] < 0.3
    assert traced["within_3_sigma_pct"] > 90
    assert ridge["coverage_pct"] > 80
    assert ridge["mpx_per_s"] > 0


def test_the_command_prints_a_table(dataset: Path, capfd: pytest.CaptureFixture[str]) -> None:
    command = CommandLine(lambda: run_command(app), capfd)
    ended = command(dataset)
    assert ended.status == 0, ended
    assert "| solver.trace | 1 | 0 |" in ended.out
    assert "| ridge | 1 |" in ended.out
    assert "has no S1/images/img0.jpg" in command.refused(dataset, "--odd")


def test_a_folder_without_images_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has no S1/images/img0.jpg, allowed is dataset/"):
        list(cases(tmp_path, odd=False))
