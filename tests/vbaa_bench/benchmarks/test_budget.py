"""The error budget: a cause that is put in is found, alone, and the causes add up."""

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from solver.antenna import Antenna
from solver.centreline import Centreline
from solver.instrument.arrays import Floats, Grey
from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import Observations
from solver.instrument.transforms import rigid
from solver.methods import METHODS
from tests.command_line import CommandLine
from tests.draws import generator
from vbaa_bench import cli
from vbaa_bench.benchmarks.budget.errors import Errors, NamedMethod, errors_of
from vbaa_bench.benchmarks.budget.shares import (
    NOISE,
    SYSTEMATIC,
    errors_by_cause,
    shares_of,
)
from vbaa_bench.benchmarks.budget.stages import Cause, Stage, stages_of, tip_lift
from vbaa_bench.benchmarks.budget.true_image import crossings, noisy, true_line
from vbaa_bench.benchmarks.budget.true_world import TrueWorld, open_world, with_nominal_board
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.report.budget import REMAINDER, TOTAL, read_budget

CAUSES = list(Cause)


def test_causes_add_up_to_the_total(random: np.random.Generator) -> None:
    errors = random.normal(size=(len(CAUSES), 50))
    assert errors_by_cause(errors).sum(axis=0) == pytest.approx(errors[0])
    shares = shares_of(Errors(errors, errors[:2], errors[0]), CAUSES, np.arange(50) // 5)
    assert shares[TOTAL].bias == pytest.approx(
        sum(share.bias for name, share in shares.items() if name not in (TOTAL, REMAINDER))
    )
    squares = {name: share.rmse * abs(share.rmse) for name, share in shares.items()}
    assert squares.pop(TOTAL) == pytest.approx(sum(squares.values()))
    assert all(share.low <= share.rmse <= share.high for share in shares.values())


def test_noise_and_systematic_error_of_the_points_are_separated(
    random: np.random.Generator,
) -> None:
    """Noise of 2 and an offset of 1 per frame, before stages without error."""
    by_stage = np.zeros((len(CAUSES), 4000))
    by_stage[0] = 1 + 2 * random.standard_normal(4000)
    by_noise = 2 * random.standard_normal((4, 4000))
    shares = shares_of(Errors(by_stage, by_noise, by_stage[0]), CAUSES, np.arange(4000) // 10)
    assert shares[NOISE].rmse == pytest.approx(2, rel=0.11)
    assert shares[SYSTEMATIC].rmse == pytest.approx(1, rel=0.35)
    assert shares[SYSTEMATIC].bias == pytest.approx(1, abs=0.18)
    assert shares[REMAINDER].rmse == 0


def test_points_move_onto_a_circle_along_their_directions() -> None:
    angle = np.linspace(0.3, 1.2, 200)
    circle = 300 * np.column_stack([np.cos(angle), np.sin(angle)])
    u = np.arange(150.0, 260.0, 7)
    points = np.column_stack([u, np.full(len(u), 200.0)])
    columns, rows = (np.tile(axis, (len(u), 1)) for axis in ([0.0, 1.0], [1.0, 0.0]))
    on_column = crossings(circle, points, columns)
    assert on_column[:, 0] == pytest.approx(u)
    assert np.hypot(*on_column.T) == pytest.approx(300, abs=1e-6)
    assert crossings(circle, points, rows)[:, 0] == pytest.approx(np.sqrt(300**2 - 200**2))
    beyond = crossings(circle, np.array([[299.9, 0.0]]), columns[:1])
    assert np.isnan(beyond).all()


def test_simulated_noise_has_the_stated_sigmas(random: np.random.Generator) -> None:
    line = Centreline(
        np.zeros((20_000, 2)),
        np.tile([0.6, 0.8], (20_000, 1)),
        np.linspace(0.01, 0.05, 20_000),
    )
    shift = noisy(line, random).points
    assert shift @ [0.8, -0.6] == pytest.approx(0)
    assert np.std(shift @ [0.6, 0.8] / line.sigma) == pytest.approx(1, rel=0.03)


@dataclass(frozen=True)
class Perfect:
    """A dataset with its truth, and an antenna that makes no error at all."""

    observations: Observations
    world: TrueWorld
    antenna: Antenna
    rows: list[dict[str, Any]]

    def shares(self, antenna: Antenna, method: str = "exact_fit") -> dict[str, float]:
        """RMSE of every cause [m] for an antenna, without simulated noise."""
        frames = list(self.observations)
        name = NamedMethod(method, METHODS[method])
        stages = stages_of(antenna, self.world)
        errors = errors_of(frames, self.rows, stages, self.world, name, 0, generator(__name__, 0))
        assert np.isfinite(errors.by_stage).all()
        groups = np.arange(len(frames))
        return {name: share.rmse for name, share in shares_of(errors, CAUSES, groups).items()}


def test_the_true_tip_is_the_rim_nearest_to_the_camera(dataset: Path) -> None:
    """The end of a straight beam that climbs from plane C by 0.5 rad."""
    camera, lift, angle = open_world(Layout(dataset)).camera, 3e-4, 0.5
    along = np.array([np.cos(angle), 0.0, np.sin(angle)])
    curve = np.linspace(0, 0.1, 50)[:, None] * along
    nothing = np.empty((0, 2))
    line = Centreline(nothing, nothing, np.empty(0), tip=np.zeros(2))
    tip = true_line(line, camera, curve, lift).tip
    rim = curve[-1] + lift * np.array([-np.sin(angle), 0.0, np.cos(angle)])
    assert tip == pytest.approx(camera.project(rim[None])[0], abs=1e-9)


@pytest.fixture(scope="module")
def perfect(dataset: Path, observations: Observations, antenna: Antenna) -> Perfect:
    world = open_world(Layout(dataset))
    stage = stages_of(antenna, world)[CAUSES.index(Cause.MODEL)]
    rows = {row["frame_id"]: row for row in world.truth.frames.iter_rows(named=True)}
    frames = list(observations)
    in_order = [rows[frame.frame_id] for frame in frames]
    lines = true_lines(frames, in_order, antenna, world)
    return Perfect(observations, world, with_lines(stage.antenna, lines), in_order)


def true_lines(
    frames: Sequence[ImageFrame], rows: Sequence[Any], antenna: Antenna, world: TrueWorld
) -> dict[bytes, Centreline]:
    """The exact centreline of every image."""
    lines = {}
    for frame, row in zip(frames, rows, strict=True):
        image = frame.image()
        measured = antenna.extract(antenna.scale(image))
        true = world.frame(row, frame.readings)
        lines[image.tobytes()] = true_line(measured, world.camera, true.line, tip_lift(antenna))
    return lines


@dataclass(frozen=True)
class Computed:
    """An extractor that is a function of the image."""

    line_of: Callable[[Grey], Centreline]
    shading: float = 1.0
    detector: None = None

    def __call__(self, image: Grey) -> Centreline:
        return self.line_of(image)


def with_lines(antenna: Antenna, lines: dict[bytes, Centreline]) -> Antenna:
    def extract(image: Grey) -> Centreline:
        return lines[image.tobytes()]

    return replace(antenna, at_rest=replace(antenna.at_rest, extract=Computed(extract)))


def shifted(antenna: Antenna, shift: Callable[[Floats], Floats]) -> Antenna:
    """An antenna whose extractor measures points shifted by shift(u) [px]."""

    def extract(image: Grey) -> Centreline:
        line = antenna.extract(image)
        off = shift(line.points[:, 0])[:, None] * line.directions
        return replace(line, points=line.points + off)

    return replace(antenna, at_rest=replace(antenna.at_rest, extract=Computed(extract)))


def alone(shares: dict[str, float], cause: Cause, within: float = 1e-5) -> None:
    """Check that one cause has the total's error, and all others have none.

    The errors that are put in are a tenth or less of those at which `exact_fit` refuses a frame, as
    its misfit, which depends on the noise of the images, is that of the wrong beam. Rounding leaves
    1e-13 m.
    """
    total = shares.pop(TOTAL)
    assert shares.pop(str(cause)) == pytest.approx(total, rel=within)
    shares.pop(REMAINDER)
    assert max(shares.values()) < within * total


def test_an_antenna_without_error_has_none(perfect: Perfect) -> None:
    assert max(perfect.shares(perfect.antenna).values()) < 1e-9


def test_a_wrong_camera_is_an_error_of_the_calibration_alone(perfect: Perfect) -> None:
    antenna = perfect.antenna
    camera = replace(antenna.calibration.camera, fx=700.03, fy=700.03)
    wrong = replace(antenna, calibration=replace(antenna.calibration, camera=camera))
    # The beam at rest as this camera sees it.
    rest = stage(wrong, perfect.world, Cause.CALIBRATION).antenna.rest
    wrong = replace(wrong, at_rest=replace(wrong.at_rest, line=rest))
    shares = perfect.shares(wrong)
    assert shares[TOTAL] > 1e-6
    alone(shares, Cause.CALIBRATION)


def test_a_wrong_clamp_is_an_error_of_the_placement_alone(perfect: Perfect) -> None:
    rig = replace(perfect.antenna.rig, base_position=np.array([5e-6, 0.0, 0.0]))
    shares = perfect.shares(replace(perfect.antenna, rig=rig))
    assert shares[TOTAL] > 2e-6
    alone(shares, Cause.PLACEMENT)


def test_a_displaced_board_is_an_error_of_the_placement_alone(perfect: Perfect) -> None:
    """The camera is calibrated without error, but relative to the board."""
    true_rig, antenna = perfect.world.rig, perfect.antenna
    nominal = antenna.rig.antenna_from_board
    board = rigid(np.array([0.0, 5e-5, 0.0]), np.array([2.5e-6, 0.0, 2.5e-5])) @ nominal
    displaced = replace(true_rig, antenna_from_board=board)
    perfect = replace(perfect, world=replace(perfect.world, rig=displaced))
    camera = with_nominal_board(displaced, nominal)
    wrong = replace(antenna, calibration=replace(antenna.calibration, camera=camera))
    rest = stage(wrong, perfect.world, Cause.CALIBRATION).antenna.rest
    wrong = replace(wrong, at_rest=replace(wrong.at_rest, line=rest))
    shares = perfect.shares(wrong)
    assert shares[TOTAL] > 1e-6
    alone(shares, Cause.PLACEMENT)


def test_wrong_points_are_an_error_of_the_centreline_alone(perfect: Perfect) -> None:
    # Up to 0.0025 px.
    wrong = shifted(perfect.antenna, lambda u: 5e-8 * (u - 30) * (u - 480))
    shares = perfect.shares(wrong)
    assert shares[TOTAL] > 5e-6
    alone(shares, Cause.CENTRELINE)


def test_a_wrong_rest_line_is_an_error_of_the_rest_pose_alone(perfect: Perfect) -> None:
    at_rest = perfect.antenna.at_rest
    rest = replace(at_rest.line, slope=at_rest.line.slope + 1e-5)
    wrong = replace(perfect.antenna, at_rest=replace(at_rest, line=rest))
    shares = perfect.shares(wrong)
    assert shares[TOTAL] > 1e-6
    alone(shares, Cause.REST)


def test_linear_theory_is_an_error_of_the_beam_model(perfect: Perfect) -> None:
    shares = perfect.shares(perfect.antenna, "linear_fit")
    assert shares[TOTAL] > 1e-4
    assert shares[Cause.MODEL] == pytest.approx(shares[TOTAL], rel=0.01)
    assert shares[Cause.OPTIMISER] < 0.01 * shares[TOTAL]


def stage(antenna: Antenna, world: TrueWorld, cause: Cause) -> Stage:
    return stages_of(antenna, world)[CAUSES.index(cause)]


@pytest.mark.thorough
def test_the_command_writes_what_the_report_reads(
    dataset: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = tmp_path / "copy"
    shutil.copytree(dataset, root)
    command = CommandLine(cli.main, capfd)
    table = tmp_path / "budget.csv"
    printed = command("budget", str(root), "-m", "exact_fit", "--json", "--out", table)
    rows = json.loads(printed.out)["rows"]
    assert [row["cause"] for row in rows] == pl.read_csv(table)["cause"].to_list()
    stored = json.loads((root / "derived" / "budget.json").read_text())["exact_fit"]
    for row in rows:
        assert row["rmse_pct_L"] == stored[row["cause"]]["rmse_pct_L"]
    shares = read_budget(root / "derived" / "budget.json")["exact_fit"]
    assert (shares[0].cause, shares[-1].cause) == (TOTAL, REMAINDER)
    by_cause = {share.cause: share for share in shares}
    # Noise has a large share in frames of a rig that is as it is said to be.
    assert by_cause[TOTAL].rmse_pct_L < 0.05
    assert by_cause[NOISE].rmse_pct_L > 0.15 * by_cause[TOTAL].rmse_pct_L
    assert Cause.PLACEMENT not in by_cause
    assert "method 'fit' is unknown, allowed is one of two_point" in command.refused(
        "budget", str(root), "-m", "fit"
    )
