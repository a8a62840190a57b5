"""Results are computed once for an object, and dropped with it."""

import gc
import weakref
from dataclasses import dataclass, replace

import numpy as np

from solver.core.once import copied, once
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
    setting: list[int] = []  # without a hash
    assert total(frame, None) == total(frame, None) == total(frame, setting) == 3
    assert total(frame, setting) == 3
    assert total(other, None) == 4
    assert calls == [None, setting, None]
    # A changed copy is another object.
    assert total(replace(frame, points=np.ones(5)), None) == 5


def test_a_result_that_holds_its_object_is_dropped_with_it() -> None:
    @once
    def held(frame: Frame, setting: object) -> tuple[Frame, object]:
        return frame, setting

    frame = Frame(np.ones(3))
    alive = weakref.ref(frame)
    held(frame, None)
    del frame
    gc.collect()
    assert alive() is None


def test_a_copy_keeps_the_results() -> None:
    calls: list[object] = []

    @once
    def size(frame: Frame, setting: object) -> int:
        calls.append(setting)
        return len(frame.points)

    frame = Frame(np.ones(3))
    assert size(frame, None) == size(copied(frame, points=np.zeros(3)), None) == 3
    assert len(calls) == 1
    assert size(replace(frame), None) == 3
    assert len(calls) == 2
