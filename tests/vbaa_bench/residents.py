"""Residents of worker processes, in a module that is imported in no time."""

import atexit
import os
import signal
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from vbaa_bench.workers.resources import own_memory_mb


class Grown(NamedTuple):
    """A job's number, and its process and memory [MB]."""

    number: int
    pid: int
    memory_mb: float


class Resident:
    """Says in which process it lives, and keeps what it is given."""

    def __init__(self, *_: object) -> None:
        self._kept = list[bytes]()

    def grow(self, tick: Callable[[], None], number: int, kept_mb: int) -> Grown:
        self._kept.append(b"1" * (kept_mb * 10**6))
        tick()
        return Grown(number, os.getpid(), own_memory_mb())

    def pid(self, _tick: Callable[[], None]) -> int:
        return os.getpid()

    def grow_and_break(self, _tick: Callable[[], None], number: int) -> int:
        """Return the number; the process is killed while it ends."""
        atexit.register(os.kill, os.getpid(), signal.SIGKILL)
        return number

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


class KindsOfLight:
    """Says which kinds of light a scene has, from which it is built."""

    def __init__(self, scene: Any) -> None:
        self._scene = scene

    def kinds(self, _tick: Callable[[], None], _name: str) -> list[str]:
        return [light.kind for light in self._scene.lights]
