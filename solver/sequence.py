"""Frames as they come: each is solved with what the push it belongs to has shown before."""

import time
from dataclasses import dataclass, replace

from solver.antenna import Antenna
from solver.centreline import Centreline
from solver.estimate import answer, measure, moved, see
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.instrument.observation import NOTHING_READ, Readings
from solver.methods import Method

# A longer push is thinned to every other frame: memory is bounded, the whole push stays in view.
LONGEST_PUSH = 32


@dataclass(frozen=True)
class Solved:
    """One frame's answer, the centreline it came from, and how long it took [s].

    `line` is None where the image could not be used; the time runs from the image in memory.
    """

    estimate: Estimate
    line: Centreline | None
    seconds: float


class Sequence:
    """Solves frames in order and remembers the push.

    A push ends where its `push_id` changes; where frames have none, as from a live camera, it ends
    with a frame that touches nothing.
    """

    def __init__(self, antenna: Antenna, method: Method) -> None:
        self._antenna, self._method = antenna, method
        self._push: list[Measurement] = []
        self._push_id = ""

    def solve(self, image: Grey, readings: Readings = NOTHING_READ, push_id: str = "") -> Solved:
        """The next frame's answer; an error of any kind becomes an outcome."""
        if push_id != self._push_id:
            self._push, self._push_id = [], push_id
        line = None
        began = time.perf_counter()
        try:
            line = see(self._antenna, image)
            refusal = moved(self._antenna, image)
            if refusal is not None:
                return Solved(refusal, line, time.perf_counter() - began)
            measurement = measure(self._antenna, line, readings, self._push)
        except (InputError, ValueError) as error:
            invalid = Estimate(Outcome.INVALID, str(error))
            return Solved(invalid, line, time.perf_counter() - began)
        except Exception as error:  # noqa: BLE001 - any failure is a row in the table
            crashed = Estimate(Outcome.CRASHED, f"{type(error).__name__}: {error}")
            return Solved(crashed, line, time.perf_counter() - began)
        estimate = answer(self._method, measurement, line.remark)
        seconds = time.perf_counter() - began
        if estimate.outcome is Outcome.NO_CONTACT and not push_id:
            self._push = []
        else:
            self._remember(measurement)
        return Solved(estimate, line, seconds)

    def _remember(self, measurement: Measurement) -> None:
        if len(self._push) == LONGEST_PUSH:
            self._push = self._push[::2]
        # Without its own past, or the chain of them would keep everything.
        self._push.append(replace(measurement, earlier=()))
