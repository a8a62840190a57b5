"""Residents of worker processes, in a module that is imported in no time."""

import os
import signal
import time
from collections.abc import Callable


class Resident:
    """Says in which process it lives."""

    def __init__(self, *_: object) -> None: ...

    def pid(self, _tick: Callable[[], None]) -> int:
        return os.getpid()

    def slow(self, tick: Callable[[], None]) -> None:
        tick()
        time.sleep(600)


def broken(reason: type[Exception]) -> Resident:
    raise reason("the lamp is missing")


def interrupted() -> None:
    os.kill(os.getpid(), signal.SIGINT)  # as the terminal does, to all processes at once


class InterruptedAtImport:
    """Interrupts the process that unpickles it, which it does before anything is set up."""

    def __reduce__(self) -> tuple[object, tuple[()]]:
        return interrupted, ()
