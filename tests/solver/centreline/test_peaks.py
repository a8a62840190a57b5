"""Peaks are those of SciPy, whose import takes longer."""

import numpy as np
import scipy.signal

from solver.centreline.second_line import find_peaks


def test_peaks_are_those_of_scipy(random: np.random.Generator) -> None:
    count = 0
    for number in range(200):
        values = random.normal(size=number % 40)
        if number % 2:
            values = np.maximum(np.round(values), 0.0)  # many equal values
        for least in (0.0, 0.5, 1.0):
            expected, shapes = scipy.signal.find_peaks(values, prominence=least)
            peaks = list(find_peaks(values, least))
            assert [peak.place for peak in peaks] == expected.tolist()
            assert [peak.prominence for peak in peaks] == shapes["prominences"].tolist()
            count += len(peaks)
    assert count > 100
