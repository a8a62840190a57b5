"""Beams that may explain the pushes, the simplest first."""

from typing import Final, NamedTuple

import numpy as np

from solver.instrument.beam_shape import BeamShape

# Prior sigma of the width's first term where the rig states none, and of the clamp's softness.
# Chosen: beams whose tip is a third as wide as their clamp, and clamps that turn by several degrees
# under a strongly bent beam.
WIDEST: Final = 0.3
SOFTEST: Final = 0.05


class Candidate(NamedTuple):
    """A beam with `widths` terms of its width, on a clamp that gives if `soft`."""

    widths: int
    soft: bool

    @property
    def name(self) -> str:
        """Words for a table."""
        width = ("uniform", "cone", "width of degree 2", "width of degree 3")[self.widths]
        return f"{width}, clamp that gives" if self.soft else width


# Most terms of the width. Chosen: pushes hardly determine more.
_MAX_WIDTHS: Final = 3


def candidates_of(stated: BeamShape) -> list[Candidate]:
    """Return the candidates, those with fewest parameters first.

    A taper, or a clamp that gives, which the rig states as possible is in all of them.
    """
    stated_soft = bool(stated.covariance[0, 0])
    candidates = [
        Candidate(widths, soft)
        for widths in range(min(len(stated.widths), _MAX_WIDTHS), _MAX_WIDTHS + 1)
        for soft in ((True,) if stated_soft else (False, True))
    ]
    return sorted(candidates, key=lambda candidate: candidate.widths + candidate.soft)


def prior_of(candidate: Candidate, stated: BeamShape) -> BeamShape:
    """Return a candidate's beam before any push, with the rig's stated section and friction.

    Terms of the width are smaller the faster they change along the beam.
    """
    taper = max(float(np.sqrt(stated.covariance[1:2, 1:2]).sum()), WIDEST)
    widths = [taper / (k + 1) ** 2 for k in range(candidate.widths)]
    return BeamShape(
        widths=np.zeros(candidate.widths),
        covariance=np.diag([SOFTEST * candidate.soft, *widths]) ** 2,
        section_sigma=stated.section_sigma,
        rigidity_sigma=stated.rigidity_sigma,
        friction_sigma=stated.friction_sigma,
    )
