"""Perturbations of rig.json: wrong statements of a laboratory about its rig."""

from dataclasses import replace

import numpy as np

from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE
from vbaa_bench.benchmarks.stress.recording import Perturbation, Recording


def square_wrong(share: float) -> Perturbation:
    """State the board's squares as larger by `share`."""

    def perturb(recording: Recording, _random: np.random.Generator) -> Recording:
        board = replace(recording.rig.board, square=recording.rig.board.square * (1 + share))
        return replace(recording, rig=replace(recording.rig, board=board))

    return perturb


def board_turned(degrees: float) -> Perturbation:
    """State the board of view 0 as turned about its own normal."""

    def perturb(recording: Recording, _random: np.random.Generator) -> Recording:
        pose = recording.rig.antenna_from_board @ turn_about_z(degrees * DEGREE)
        return replace(recording, rig=replace(recording.rig, antenna_from_board=pose))

    return perturb


def length_wrong(share: float) -> Perturbation:
    """State the beam as longer by `share`."""

    def perturb(recording: Recording, _random: np.random.Generator) -> Recording:
        beam = replace(recording.rig.beam, length=recording.rig.beam.length * (1 + share))
        return replace(recording, rig=replace(recording.rig, beam=beam))

    return perturb
