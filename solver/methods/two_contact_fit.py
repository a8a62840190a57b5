"""Least squares with the exact beam and one contact, or two where one leaves a misfit.

The known plane, the beam and the nuisance parameters are those of `exact_fit`, and its estimate is
returned wherever its residuals look like noise. Two contacts are fitted to the other frames, with
the same prior of taper, section, bow, friction and clamp. They are accepted if they leave no more
than noise, and if the image determines both in spite of that prior; otherwise the outcome is that
of `exact_fit`, or "not identifiable" where the misfit shows a second contact that the image does
not place: a single one would be biased. The first contact along the beam has the names of a single
one.

This is no part of `exact_fit`: two places and two forces also follow the shape of beams that are
not as the rig states, which `exact_fit` refuses.
"""

from solver.core.robust import noise_chi2
from solver.core.thresholds import THRESHOLDS
from solver.fitting.two_contact_estimate import two_contact_estimate
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit


def two_contact_fit(measurement: Measurement) -> Estimate:
    """Estimate one contact or two, with forces, in the known plane; with joint covariance."""
    single = exact_fit(measurement)
    if not _leaves_misfit(measurement, single):
        return single
    double = two_contact_estimate(measurement)
    return double if double.outcome.has_values or _is_biased(single, double) else single


def _is_biased(single: Estimate, double: Estimate) -> bool:
    """Test whether a second contact, which the image does not determine, biases a single one."""
    if single.chi2 is None or double.chi2 is None:
        return False
    reduced = single.chi2 - double.chi2 > THRESHOLDS.min_second_chi2
    return reduced and double.outcome is Outcome.NOT_IDENTIFIABLE


def _leaves_misfit(measurement: Measurement, single: Estimate) -> bool:
    """Test whether a fit of one contact failed, or does not explain all points by their noise."""
    if not single.outcome.has_values:
        return single.outcome is not Outcome.NO_CONTACT
    chi2, dof = single.chi2, single.dof
    if chi2 is None or dof is None:
        return False
    points = len(measurement.points)
    rejected = 1 - dof / points
    return chi2 / dof > noise_chi2(dof) or rejected > THRESHOLDS.max_rejected_beside_two
