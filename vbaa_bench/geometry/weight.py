"""Mesh of a weight that hangs from the beam."""

import numpy as np
import trimesh

from vbaa_bench.geometry.solids import rod, together
from vbaa_bench.geometry.tube import tube

# Sides of the thread, and segments of its loop around the beam.
_THREAD_SIDES, _LOOP_SEGMENTS = 12, 96


def weight(
    beam_radius: float,
    slope: float,
    thread_radius: float,
    thread_length: float,
    radius: float,
    height: float,
) -> trimesh.Trimesh:
    """Mesh a loop around the beam, a thread down from it, and a cylinder; all lengths are [m].

    The beam's axis passes through the origin, in the x-y plane, with the given slope against x;
    -y is down. The three bodies overlap where they meet.
    """
    turn = np.linspace(0, 2 * np.pi, _LOOP_SEGMENTS + 1)[:, None]
    across = np.array([-slope, 1.0, 0.0]) / np.hypot(1.0, slope)
    side = np.array([0.0, 0.0, 1.0])
    around = (beam_radius + thread_radius) * (np.cos(turn) * across + np.sin(turn) * side)
    # Below the sloping beam, within the loop.
    top = np.array([0.0, -beam_radius * np.hypot(1.0, slope) - thread_radius * abs(slope), 0.0])
    end = np.array([0.0, -thread_length, 0.0])
    return together(
        [
            tube(around, thread_radius, _THREAD_SIDES),
            tube(np.array([top, end]), thread_radius, _THREAD_SIDES),
            rod(end, end - [0.0, height, 0.0], radius),
        ]
    )
