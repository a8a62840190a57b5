"""Stages of the budget: antennas in which one stage after the other is replaced by the truth."""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.centreline import Centreline
from solver.instrument.arrays import Floats, Grey
from solver.instrument.camera import Camera
from solver.planes.plane_c import on_plane
from solver.planes.sag import correct_for_sag
from vbaa_bench.benchmarks.budget.true_world import TrueWorld, with_nominal_board

# Terms of `solver.at_rest.rest_line.RestLine`: a line and a bow of the powers 2 to 4.
_TERMS: Final = 5


class Cause(StrEnum):
    """Causes of an error, in the order in which they are removed."""

    CENTRELINE = "centreline points"
    TIP = "tip in the image"
    REST = "rest pose"
    CALIBRATION = "camera calibration"
    PLACEMENT = "clamp and board placement"
    READINGS = "sensor readings"
    PARAMETERS = "beam length and EI"
    MODEL = "beam model"
    OPTIMISER = "optimiser and method"


class Source(StrEnum):
    """Where the points and the readings of a variant come from."""

    MEASURED = "measured"
    MEASURED_TIP = "true points, measured tip and readings"
    TRUE_POINTS = "true points and tip, measured readings"
    TRUE = "true points and readings"
    MODEL = "points and readings of the solver's own beam"


class Stage(NamedTuple):
    """A variant of the solver: its antenna, its source, and the cause that the next one removes."""

    cause: Cause
    source: Source
    antenna: Antenna


@dataclass
class Substitute:
    """Extractor that returns `line`, whatever the image shows."""

    line: Centreline
    shading: float = 1.0
    detector: None = None

    def __call__(self, image: Grey) -> Centreline:
        """Return the centreline; the image is not used."""
        del image
        return self.line


def stages_of(antenna: Antenna, world: TrueWorld) -> list[Stage]:
    """List the stages in order: as measured, then with one more true stage each.

    After the last stage nothing is left but the method's own arithmetic. The antennas of all but
    the first stage measure nothing: their extractor is a `Substitute`, whose line is set for each
    frame. True points are not shifted by light from one side.
    """
    nothing = Centreline(np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    rest_camera = world.rig.camera
    light = replace(antenna.rig.light, slope=0.0, distance=None)
    rig, at_rest = replace(antenna.rig, light=light), antenna.at_rest
    at_rest = replace(at_rest, extract=Substitute(nothing))
    points = replace(antenna, rig=rig, at_rest=at_rest)
    rest = _rested(points, rest_camera, world.rest_line)
    board = with_nominal_board(world.rig, rig.antenna_from_board)
    knocked = replace(board, cx=world.camera.cx, cy=world.camera.cy)
    seen_from = replace(rest.calibration, camera=knocked, viewpoint_known=True)
    calibrated = _rested(replace(rest, calibration=seen_from), world.camera, world.rest_line)
    placed = replace(
        calibrated,
        rig=replace(rig, base_position=world.rig.base_position),
        calibration=replace(seen_from, camera=world.camera),
    )
    placed = _rested(placed, world.camera, world.rest_line)
    beam = replace(placed, rig=replace(placed.rig, beam=world.rig.beam))
    own = replace(beam, rig=replace(beam.rig, sag=0.0, sag_in_plane=np.zeros(2)))
    own = _rested(own, world.camera, world.straight_line)
    return [
        Stage(Cause.CENTRELINE, Source.MEASURED, antenna),
        Stage(Cause.TIP, Source.MEASURED_TIP, _separate(points)),
        Stage(Cause.REST, Source.TRUE_POINTS, _separate(points)),
        Stage(Cause.CALIBRATION, Source.TRUE_POINTS, _separate(rest)),
        Stage(Cause.PLACEMENT, Source.TRUE_POINTS, _separate(calibrated)),
        Stage(Cause.READINGS, Source.TRUE_POINTS, _separate(placed)),
        Stage(Cause.PARAMETERS, Source.TRUE, _separate(placed)),
        Stage(Cause.MODEL, Source.TRUE, _separate(beam)),
        Stage(Cause.OPTIMISER, Source.MODEL, _separate(own)),
    ]


def tip_lift(antenna: Antenna) -> float:
    """Compute the height [m] above the axis of the visible tip, as `Antenna` corrects it."""
    return antenna.rig.beam.radius * math.pi / 4


def substitute_of(antenna: Antenna) -> Substitute:
    """Return the substitute extractor of a stage's antenna."""
    extract = antenna.extract
    assert isinstance(extract, Substitute)
    return extract


def _separate(antenna: Antenna) -> Antenna:
    """Give an antenna a substitute of its own."""
    extract = Substitute(substitute_of(antenna).line)
    return replace(antenna, at_rest=replace(antenna.at_rest, extract=extract))


def _rested(antenna: Antenna, camera: Camera, line: Floats) -> Antenna:
    """Give an antenna the rest pose that a perfect extraction of `line` (n, 3) [m] gives.

    `camera` takes the rest images; the antenna's own camera projects them to plane C, so that
    errors of its calibration cancel as they do for measured points. The covariance stays.
    """
    pixels = camera.project(line)
    inside = (pixels >= -0.5) & (pixels <= [camera.width - 0.5, camera.height - 0.5])
    shown = camera.shows(line) & inside.all(axis=1)
    own, rig = antenna.calibration.camera, antenna.rig
    points, _ = on_plane(own, pixels[shown], np.zeros((int(shown.sum()), 2)))
    points = correct_for_sag(points, own.viewpoint, rig)
    rest = antenna.rest
    t = (points[:, 0] - rig.base_position[0]) / rest.length
    y_at_clamp, slope, *bow = np.linalg.lstsq(np.vander(t, _TERMS, increasing=True), points[:, 1])[
        0
    ]
    rest = replace(
        rest,
        y_at_clamp=float(y_at_clamp),
        slope=float(slope / rest.length),
        bow=np.array(bow),
    )
    tip = antenna.at_rest.tip
    if tip is not None:
        tip = camera.project((line[-1] + [0.0, 0.0, tip_lift(antenna)])[None])[0]
    return replace(antenna, at_rest=replace(antenna.at_rest, line=rest, tip=tip))
