"""Beams and clamps that may explain the pushes, the simplest first."""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from solver.instrument.beam_shape import (
    CLAMP_SHIFT,
    SOFTNESS,
    BeamShape,
    skew_sigma,
)

# Prior sigmas of the width's first term, of the clamp's softness and of its place over the length,
# where the rig states none. Chosen: beams whose tip is a third as wide as their clamp, clamps that
# turn by several degrees under a strongly bent beam, and wires gripped 5 mm deeper on 240 mm.
WIDEST: Final = 0.3
SOFTEST: Final = 0.05
FARTHEST: Final = 0.02


class Candidate(NamedTuple):
    """A beam with `widths` terms of its width, on a compliant clamp if `soft`.

    If `shifted` it begins to bend at another place than the rig's clamp. The two are almost alike:
    the first millimetre of a beam turns it as a compliant clamp does. If `stated`, width and clamp
    have the sigmas that the rig states, which others may exceed.
    """

    widths: int
    soft: bool
    shifted: bool = False
    stated: bool = False

    @property
    def name(self) -> str:
        """Words for a table."""
        width = ("uniform", "cone", "width of degree 2", "width of degree 3")[self.widths]
        soft = ", compliant clamp" if self.soft else ""
        shifted = ", clamp elsewhere" if self.shifted else ""
        return width + soft + shifted + (", as far as the rig states" if self.stated else "")

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.widths + self.soft + self.shifted


# Most terms of the width. Chosen: pushes hardly determine more.
_MAX_WIDTHS: Final = 3


def candidates_of(stated: BeamShape) -> list[Candidate]:
    """Return the candidates, those with fewest parameters first.

    A taper, or a clamp that is compliant or elsewhere, which the rig states as possible is in all
    of them, and in the first one no larger than stated. Of equally simple ones, a compliant clamp
    comes before one that is elsewhere.
    """
    soft, shifted = bool(stated.sigma(SOFTNESS)), bool(stated.sigma(CLAMP_SHIFT))
    clamps = [(soft, shifted), (True, shifted), (soft, True)]
    candidates = [
        Candidate(widths, *clamp)
        for widths in range(min(len(stated.widths), _MAX_WIDTHS), _MAX_WIDTHS + 1)
        for clamp in dict.fromkeys(clamps)
    ]
    first, *_ = candidates
    learned = stated.widths.any() or stated.softness
    if first.size and not learned:
        candidates.insert(0, first._replace(stated=True))
    return sorted(candidates, key=lambda candidate: candidate.size)


def prior_of(candidate: Candidate, stated: BeamShape) -> BeamShape:
    """Return a candidate's beam before any push, with the rig's stated section and friction.

    Terms of the width are smaller the faster they change along the beam. Where the clamp is both
    compliant and elsewhere, only what the rig states of each distinguishes them.
    """
    taper = stated.taper_sigma if candidate.stated else max(stated.taper_sigma, WIDEST)
    widths = [taper / (k + 1) ** 2 for k in range(candidate.widths)]
    softness = (stated.sigma(SOFTNESS) if candidate.shifted or candidate.stated else 0.0) or SOFTEST
    shift = stated.sigma(CLAMP_SHIFT) or FARTHEST
    sigmas = [softness * candidate.soft, shift * candidate.shifted]
    skew = skew_sigma(stated.section_sigma)
    return replace(
        stated,
        widths=np.zeros(candidate.widths),
        softness=0.0,
        clamp_shift=0.0,
        skew=0.0,
        bow=np.zeros(0),
        covariance=np.diag([*sigmas, skew, *widths]) ** 2,
    )
