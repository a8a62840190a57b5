"""Detection of a target in one view."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats


@dataclass(frozen=True)
class BoardDetection:
    """Points of a target in one view: `numbers` (n,) into `Board.corners()`, `pixels` (n, 2)."""

    numbers: npt.NDArray[np.int64]
    pixels: Floats

    def __len__(self) -> int:
        return len(self.numbers)
