"""Looking dotted keys up in a JSON document, and saying clearly what is wrong with one."""

import difflib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError


@dataclass(frozen=True)
class Keys:
    """A JSON document and the file it came from.

    Every look-up raises InputError naming file, key, value and what is allowed. `asked` are the
    keys that were looked up.
    """

    path: Path
    document: Any
    asked: set[str] = field(default_factory=set)

    def refuse_others(self) -> None:
        """Raise InputError where the document holds a key for which nobody has asked."""
        for key in _names(self.document):
            if not any(asked == key or asked.startswith(f"{key}.") for asked in self.asked):
                nearest = difflib.get_close_matches(key, self.asked, n=1, cutoff=0.0)[0]
                raise InputError(
                    f"{self.path}: the key {key} means nothing here, "
                    f"the nearest allowed is {nearest}"
                )

    def _value(self, key: str) -> Any:
        self.asked.add(key)
        value = self.document
        for part in key.split("."):
            if not isinstance(value, dict) or part not in value:
                raise InputError(f"{self.path}: the key {key} is missing")
            value = value[part]
        return value

    def has(self, key: str) -> bool:
        """Whether there is such a key."""
        self.asked.add(key)
        value = self.document
        for part in key.split("."):
            if not isinstance(value, dict) or part not in value:
                return False
            value = value[part]
        return True

    def number(self, key: str, low: float, high: float = math.inf) -> float:
        """A finite number from `low` to `high`."""
        value = self._value(key)
        if not _is_finite_number(value) or not low <= value <= high:
            bounds = f">= {low:g}" + ("" if high == math.inf else f" and <= {high:g}")
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a number {bounds}")
        return float(value)

    def count(self, key: str, low: int) -> int:
        """A whole number from `low`."""
        value = self._value(key)
        if not isinstance(value, int) or isinstance(value, bool) or value < low:
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a whole number >= {low}")
        return value

    def positive(self, key: str) -> float:
        """A finite number above zero."""
        value = self._value(key)
        if not _is_finite_number(value) or value <= 0:
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a number > 0")
        return float(value)

    def one_of(self, key: str, allowed: tuple[str, ...]) -> str:
        """One of the allowed texts."""
        value = self._value(key)
        if value not in allowed:
            raise InputError(
                f"{self.path}: {key} is {value!r}, allowed is one of {', '.join(allowed)}"
            )
        return str(value)

    def triple(self, key: str) -> Floats:
        """Three finite numbers (3,)."""
        value = self._value(key)
        if not (isinstance(value, list) and len(value) == 3 and all(map(_is_finite_number, value))):
            raise InputError(f"{self.path}: {key} is {value!r}, allowed is a list of three numbers")
        return np.array(value, dtype=np.float64)


def _names(document: dict[str, Any], before: str = "") -> Iterator[str]:
    """Every dotted key of a document, sections before what they hold."""
    for name, value in document.items():
        yield before + name
        if isinstance(value, dict):
            yield from _names(value, f"{before}{name}.")


def _is_finite_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < 1e300 and math.isfinite(value)  # a whole number may exceed every float
