"""Users' modules are forgotten after a test: each is of the whole process."""

import contextlib
import sys
from collections.abc import Iterator

from vbaa_bench.scene import user_modules
from vbaa_bench.scene.families import MODULES_IN_USE, rebuild
from vbaa_bench.scene.schema import Scene


def forget_modules() -> None:
    """Use none of the users' modules any more."""
    for name in user_modules._IN_USE:
        sys.modules.pop(name, None)
    user_modules._IN_USE.clear()
    MODULES_IN_USE.clear()
    rebuild(Scene)


@contextlib.contextmanager
def forgotten() -> Iterator[None]:
    """Forget within this block, and after it, which modules are used."""
    forget_modules()
    try:
        yield
    finally:
        forget_modules()
