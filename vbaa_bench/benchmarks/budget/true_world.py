"""Truth of a dataset as the budget's variants use it: beams, readings and the rig."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.image_frame import Readings
from solver.instrument.transforms import apply, invert, rigid
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth, open_truth
from vbaa_bench.mechanics import linear, planar
from vbaa_bench.mechanics.state import EquilibriumError
from vbaa_bench.scene.load import recorded_scene
from vbaa_bench.scene.rigs import TrueRig, true_rig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scoring.camera_frame import camera_frame_from_clamp

Row = Mapping[str, Any]


class TrueFrame(NamedTuple):
    """Beam `line` (n, 3) [m] in the fixed camera's frame, x_c [m] and exact readings of a frame."""

    line: Floats
    x_c: float
    readings: Readings


@dataclass(frozen=True)
class TrueWorld:
    """Truth of a dataset: its tables, and the scene and the rig that they were made from."""

    truth: Truth
    scene: Scene
    rig: TrueRig

    @property
    def camera(self) -> Camera:
        """The camera of the frames."""
        return self.truth.camera

    @cached_property
    def rest_line(self) -> Floats:
        """The beam at rest (n, 3) [m] in the fixed camera's frame, at motor angle zero."""
        experiment = Experiment.at_rest(self.scene, self.rig, Path())
        return self._placed(experiment.rest.centreline[:, 1:], 0.0)

    @cached_property
    def straight_line(self) -> Floats:
        """A straight beam at rest (n, 3) [m], as the solver's models have it."""
        x = np.linspace(0.0, self.rig.beam.length, 100)
        return self._placed(np.column_stack([x, np.zeros((len(x), 2))]), 0.0)

    def frame(self, row: Row, readings: Readings) -> TrueFrame:
        """Return the truth of a frame, with exact values of the `readings` that it has."""
        line = np.column_stack([row[f"centreline_{axis}_mm"] for axis in "xyz"]) * MILLIMETRE
        force = np.array(row["base_force_n"], float)
        moment = np.array(row["base_moment_n_mm"], float) * MILLIMETRE
        x_c = row["x_c_mm"]
        return TrueFrame(
            self._placed(line, row["true_motor_angle_deg"] * DEGREE),
            math.nan if x_c is None else x_c * MILLIMETRE,
            _exact(readings, row["true_motor_angle_deg"] * DEGREE, force, moment),
        )

    def model_frame(self, row: Row, readings: Readings, is_linear: bool) -> TrueFrame | None:
        """Return the frame as a solver's own beam has it: uniform, weightless and frictionless.

        The beam touches one object at the true distance, in the true plane, with the true
        deflection. `is_linear` chooses eqs. (9) and (10) instead of the exact beam. None if such a
        beam has no equilibrium there.
        """
        if row["contact_distance_at_rest_mm"] is None or row["psi_deg"] is None:
            return None
        distance = row["contact_distance_at_rest_mm"] * MILLIMETRE
        push = linear.push if is_linear else planar.push
        try:
            state = push(
                self.rig.beam, distance, deflection=row["deflection_pct"] * PERCENT, intervals=2000
            )
        except (EquilibriumError, ValueError):
            return None
        inclined = rigid(np.array([row["psi_deg"] * DEGREE, 0.0, 0.0]), np.zeros(3))[:3, :3]
        angle = row["true_motor_angle_deg"] * DEGREE
        return TrueFrame(
            self._placed(state.centreline[:, 1:] @ inclined.T, angle),
            float(state.contact.point[0]),
            _exact(readings, angle, inclined @ state.base_force, inclined @ state.base_moment),
        )

    def _placed(self, points: Floats, motor_angle: float) -> Floats:
        return apply(camera_frame_from_clamp(self.truth, motor_angle), points)


def _exact(readings: Readings, motor_angle: float, force: Floats, moment: Floats) -> Readings:
    """Replace the readings that exist; the removed stretch stays."""
    fx, fy, fz = map(float, force)
    mx, my, mz = map(float, moment)
    return replace(
        readings,
        motor_angle=None if readings.motor_angle is None else motor_angle,
        # Exerted by the beam on the sensor; the others by the clamp on the beam.
        moment_y=None if readings.moment_y is None else -my,
        base_force=None if readings.base_force is None else (fx, fy, fz),
        base_moment=None if readings.base_moment is None else (mx, my, mz),
    )


def open_world(layout: Layout) -> TrueWorld:
    """Open the truth of a dataset. Raises InputError."""
    truth = open_truth(layout.truth)
    scene = recorded_scene(truth.manifest["scene"], layout.manifest, layout.files).scene
    return TrueWorld(truth, scene, true_rig(scene))


def with_nominal_board(rig: TrueRig, antenna_from_board: Floats) -> Camera:
    """Return the true camera relative to the board, assumed at its nominal pose.

    The board's displacement is the laboratory's error, with a tolerance of its own.
    """
    true = rig.camera
    pose = true.camera_from_antenna @ rig.antenna_from_board @ invert(antenna_from_board)
    return replace(true, camera_from_antenna=pose)
