"""Results are computed once for an object, and dropped with it."""

import gc
from dataclasses import dataclass

import numpy as np

from solver.core.once import once
from solver.instrument.arrays import Floats


@dataclass(frozen=True)
class Frame:
    points: Floats


def test_a_result_is_kept_with_its_object_and_setting() -> None:
    calls: list[object] = []

    @once
    def total(frame: Frame, setting: object) -> float:
        calls.append(setting)
        return float(frame.points.sum())

    frame, other = Frame(np.ones(3)), Frame(np.ones(4))
    assert [total(frame, None), total(frame, None), total(frame, "x"), total(other, None)] == [
        3,
        3,
        3,
        4,
    ]
    assert calls == [None, "x", None]
    del frame
    gc.collect()
    # A new object may have the same identity.
    for count in range(1, 50):
        assert total(Frame(np.ones(count)), None) == count
