"""Correct the predicted numbers of samples per pixel, so that images have the target noise.

Pilot samples predict how many samples a pixel needs. The prediction is too high where it takes the
largest of its neighbours' variances, and too low where the variance falls more slowly than assumed.
The error depends on the scene, so the correction is learned once per dataset, from renders that are
not kept: where the variance of pixels with the same prediction differs on average from the target,
their numbers of samples are scaled. A pixel's number of samples still does not depend on the
samples that are averaged, so the mean remains unbiased.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Mask

# The variance of a stratified mean falls as N^-1.5 where a beam's edge crosses the pixel, as N^-1
# in shadows, and as N^-0.85 in the narrow penumbra near the beam, where the beam occludes so small
# a part of a lamp that additional points hit that part only by chance. In the order of `kinds`.
_DECAYS = np.array([1.5, 1.5, 1.5, 1.0, 0.85])
# The predictions of a row of the table differ by less than this factor, from 1 to 512 samples.
_STEP, _ROWS = 2**0.5, 19
# The learned ratio of variances is that of the pixels and of this many more with the ratio 1.
# Chosen: fewer pixels hardly matter to an image, determine little, as the variance of one pixel has
# one degree of freedom, and are what another processor's rounding would change.
_PRIOR_PIXELS = 100
# Factors and numbers of samples are whole powers of this: they follow from variances, which differ
# by about 1e-4 on a processor that rounds differently (measured), and are then equal in nearly all
# pixels. Chosen: rounding by half a step, 9 %, changes the noise by 5 %.
_ROUNDING_STEP = 2**0.25
# Range of the change of a factor by one round. Chosen: predictions may be ten times too high.
_SMALLEST_CHANGE, _LARGEST_CHANGE = 0.1, 3.0


def kinds(dense: Mask, covered: Mask, change: bool) -> npt.NDArray[np.uint8]:
    """Number the kinds of pixels (n,), of which each has its own factors.

    0: the complete scene; 1: where it is `dense`, so that each pixel has its own pilot; 2: where
    the beam is `covered` by pilots; 3: the `change` by shadows; 4: where that is dense.
    """
    kind = 3 + dense if change else np.where(covered, 2, dense)
    return np.asarray(kind, np.uint8)


class Sampled(NamedTuple):
    """Sampled pixels (n,): kind, predicted samples per set, and variance over its target."""

    kind: npt.NDArray[np.uint8]
    predicted: Floats
    excess: Floats


@dataclass(frozen=True)
class SampleTable:
    """Factors (kinds, rows) of predicted numbers of samples, by kind and number."""

    factors: Floats = field(default_factory=lambda: np.ones((len(_DECAYS), _ROWS)))

    @staticmethod
    def predicted(kind: npt.NDArray[np.uint8], pilot: int, excess: Floats) -> Floats:
        """Predict samples (n,) per set from `pilot` samples with variance over target `excess`."""
        return np.asarray(pilot * excess ** (1 / _DECAYS[kind]))

    def corrected(self, kind: npt.NDArray[np.uint8], predicted: Floats) -> Floats:
        """Correct predicted numbers of samples (n,)."""
        return np.asarray(predicted * self.factors[kind, _rows(predicted)])

    def refined(self, sampled: Sampled) -> Self:
        """Scale the factors by the excess variance of pixels that were sampled with this table."""
        cell = sampled.kind.astype(np.intp) * _ROWS + _rows(sampled.predicted)
        count = np.bincount(cell, minlength=self.factors.size)
        total = np.bincount(cell, sampled.excess, minlength=self.factors.size)
        ratio = (total + _PRIOR_PIXELS) / (count + _PRIOR_PIXELS)
        change = ratio.reshape(self.factors.shape) ** (1 / _DECAYS[:, None])
        factors = self.factors * np.clip(change, _SMALLEST_CHANGE, _LARGEST_CHANGE)
        return type(self)(rounded(factors))


def rounded(values: Floats) -> Floats:
    """Round positive values (n,) to whole powers of _ROUNDING_STEP."""
    return np.asarray(_ROUNDING_STEP ** np.rint(np.log(values) / np.log(_ROUNDING_STEP)))


def _rows(predicted: Floats) -> npt.NDArray[np.intp]:
    rows = np.rint(np.log(np.maximum(predicted, 1.0)) / np.log(_STEP))
    return np.asarray(np.minimum(rows, _ROWS - 1), np.intp)
