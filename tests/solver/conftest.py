"""Two pure functions that cost most are computed once for equal images, in all tests of a process.

The example rig and the tests' dataset are opened by many tests: a board's points and the beam's
appearance depend on the images and on what is passed beside them alone. The tests of calibration
call the original.
"""

import pickle
from collections.abc import Callable, Iterator
from dataclasses import asdict, is_dataclass
from typing import Any, Final

import pytest

from solver import calibrate
from solver.centreline.appearance import learn_appearance

DETECT_BOARD: Final = calibrate.detect_board


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function, which keeps its results; exceptions are raised anew."""
    results: dict[bytes, Any] = {}

    def kept(*arguments: Any) -> Any:
        # Without what an argument has cached in itself.
        values = [
            (type(one).__name__, asdict(one))
            if is_dataclass(one) and not isinstance(one, type)
            else one
            for one in arguments
        ]
        key = pickle.dumps(values)
        if key not in results:
            results[key] = function(*arguments)
        return results[key]

    return kept


@pytest.fixture(scope="session", autouse=True)
def _computed_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrate, "detect_board", once(DETECT_BOARD))
        patch.setattr("solver.centreline.extractor.learn_appearance", once(learn_appearance))
        yield
