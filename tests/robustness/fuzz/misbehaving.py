"""Kinds of input that misbehave, for tests of the pool."""

import os
import sys
import time
import warnings
from pathlib import Path
from random import Random

import numpy as np

from solver.instrument.errors import InputError
from tests.robustness.fuzz.case import Kind


class Misbehaving(Kind):
    """Does what its case's number says."""

    def __init__(self, material: Path) -> None:
        self._material = material
        self._number = -1

    def attempt(self, chance: Random, folder: Path) -> None:
        """Do the next of several things."""
        self._number += 1
        (folder / "input").write_text(f"{chance.random()}", encoding="utf-8")
        match self._number:
            case 0:
                raise InputError(f"{folder}/input: is wrong")
            case 1:
                raise KeyError("x")
            case 2:
                raise InputError("is wrong")
            case 3:
                warnings.warn("a warning", stacklevel=1)
            case 4:
                os.write(2, b"from compiled code")
            case 5:
                os.write(2, b"libpng error: from compiled code")
                raise InputError(f"{folder}/input: is wrong")
            case 6:
                assert np.ones(40_000_000).sum() > 0  # 320 MB


class Fatal(Kind):
    """Ends its process, writes outside of its folder, or computes nothing for ever."""

    def __init__(self, material: Path) -> None:
        self._material = material

    def attempt(self, chance: Random, folder: Path) -> None:
        """Do one of three things by chance."""
        what = chance.choice(("die", "write", "wait", "nothing"))
        (folder / "input").write_text(what, encoding="utf-8")
        if what == "die":
            os.abort()
        elif what == "write":
            (self._material / "new").write_text("x", encoding="utf-8")
            (self._material / "new").unlink()
        elif what == "wait":
            sys.stderr.write("")
            time.sleep(3600)
