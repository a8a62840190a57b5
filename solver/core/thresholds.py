"""Thresholds of the fits, and of the verdict on their results, for all methods.

Derived: computed from what is stated. Measured: on what is stated. Chosen: by judgement.
"""

import math
from typing import Final, NamedTuple


class FittingThresholds(NamedTuple):
    """Thresholds of the fits, and of the verdict on their results, for all methods."""

    # A bend, in sigmas, for which there is contact. Derived: noise exceeds it about once in a
    # million frames.
    contact_sigmas: float = 5.0
    # Fewest points of a bend. Derived: one more than its amplitude, offset and tilt.
    min_bend_points: int = 4
    # Residuals [sigma] above which a frame is fitted robustly. Derived: the largest of 500
    # residuals of white noise exceeds it in one frame of 3500.
    suspicious_sigmas: float = 5.0
    # A scale of the residuals between these means that the sigmas are understated, not that there
    # are outliers. Chosen.
    min_scale: float = 1.1
    max_scale: float = 2.0
    # cos(psi) - W_y sin(psi): rays may not graze plane D more closely. Chosen: errors grow fifty
    # times.
    min_grazing: float = 0.02
    # Fewest points of a fit: five parameters and three degrees of freedom. Chosen.
    min_points: int = 8
    # If less than this fraction of the beam is visible from the clamp on, chi2 may have no minimum.
    # Chosen.
    short_stretch: float = 0.25
    # If more than this fraction of the points is rejected, the model is wrong. Chosen: below the
    # half at which robust fits break down.
    max_rejected: float = 0.45
    # The same for rejected points in runs of five and more. Chosen: an occluder's edge affects
    # fewer.
    max_in_runs: float = 1 / 3
    # Above this fraction in runs, the other points must have at most this chi2 per degree of
    # freedom. Chosen: those of a beam with two contacts have more.
    some_in_runs: float = 0.1
    max_chi2_beside_runs: float = 1.4
    # The same for all rejected points of a fit of two contacts. Chosen: far fewer than the points
    # on a stretch that a second contact bends, which no fit may reject. If a fit of one contact
    # rejects more, two contacts are tried.
    max_rejected_beside_two: float = 0.05
    # Reduction of chi2 that shows a second contact. Derived: five sigmas.
    min_second_chi2: float = 25.0
    # Chi2 per degree of freedom of a fit. Chosen: residuals twice as large as stated are not those
    # of an exact beam with one contact.
    max_chi2: float = 4.0
    # If the sigma of x_c exceeds this fraction of the beam's length, the contact is only an
    # interval. Chosen: three sigmas to either side cover six sevenths of the beam.
    weak_sigma: float = 1 / 7
    # A contact beyond the tip by more than this many sigmas is impossible. Chosen.
    beyond_tip_sigmas: float = 3.0
    # x_c in sigmas. Chosen: with a short visible stretch noise alone gives contacts nearer to the
    # clamp, which their sigma does not show.
    x_c_sigmas: float = 4.0
    # A contact may be held for this fraction of the way from first contact to the motor's reversal.
    # Measured: it never exceeded 7 % (see `sliding`).
    held_fraction: float = 0.1
    # A motor behind its farthest angle by more encoder sigmas than this has turned back. Chosen.
    back_sigmas: float = 3.0
    # Probability that a push with a single object, or a frictionless contact with a force sensor,
    # is rejected. Chosen.
    false_rejection: float = 0.0001
    # Probability that noise alone of a force sensor exceeds the threshold of a load. Derived: that
    # of five sigmas.
    false_alarm: float = 5.7e-07
    # A compliance in sigmas above which an object is distinguished from a rigid one. Chosen.
    soft_sigmas: float = 2.0
    # A radius or a compliance below zero by this many sigmas is impossible. Chosen.
    impossible_sigmas: float = 4.0
    # A motor turned by fewer sigmas of its encoder counts as not turned. Chosen.
    min_turn_sigmas: float = 5.0
    # Least encoder sigma [rad], for an encoder stated as exact. Chosen: smaller than any shape can
    # resolve.
    min_encoder_sigma: float = 1e-06
    # Sigma of psi [rad] above which force and plane are not identifiable. Chosen: 30 degrees.
    max_psi_sigma: float = math.radians(30)
    # Minima whose chi2 exceeds the best by less than this are possible solutions. Derived: three
    # sigmas.
    close_chi2: float = 9.0
    # Increase of chi2 by the tip above which the fit leaves the tip out. Derived: five sigmas.
    max_tip_chi2: float = 25.0


THRESHOLDS: Final = FittingThresholds()
