"""A resident of a worker process that can die, in a module that imports quickly."""

import os
from collections.abc import Callable


class Mortal:
    """A worker's object with one job that ends the process and one that succeeds."""

    def die(self, _tick: object) -> None:
        os._exit(9)

    def meter(self, tick: object, _given_up: object) -> None:
        self.die(tick)

    def live(self, tick: Callable[[], None], _number: int) -> None:
        tick()
