"""Look-up of dotted keys in a JSON document, with clear error messages."""

import difflib
import json
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.hashes import read_bytes

# A key or a value is truncated to this number of characters in messages.
_MAX_CHARACTERS: Final = 80
_SHORT_REPR: Final = reprlib.Repr()
_SHORT_REPR.maxstring = _SHORT_REPR.maxother = _SHORT_REPR.maxlong = _MAX_CHARACTERS
# Largest document [bytes]: a hundred times the size of one with every key.
_MAX_BYTES: Final = 1 << 18
# Similarity from which a key is a misspelt one. Chosen: two letters of ten may be wrong, and no two
# keys of rig.json of one section and as many words are so similar.
_SIMILAR: Final = 0.8
_MISSING: Final = object()


@dataclass(frozen=True)
class Keys:
    """JSON document and the file it was read from.

    Every look-up raises InputError with file, key, value and the allowed values. An item of a list
    has its index, from 0, as a part of its key: `photos.0.file`. `asked` contains the keys that
    were looked up.
    """

    path: Path
    document: Any
    asked: set[str] = field(default_factory=set)

    @classmethod
    def read(cls, path: Path) -> "Keys":
        """Read a JSON file.

        Raises InputError if it is not JSON, too large, nested too deeply, or not the one that was
        generated.
        """
        try:
            if path.is_file() and path.stat().st_size > _MAX_BYTES:
                raise InputError(f"{path}: is larger than {_MAX_BYTES} bytes, the limit for JSON")
            text = read_bytes(path).decode("utf-8")
            return cls(path, json.loads(text, object_pairs_hook=_section))
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from error
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}: is not JSON ({error})") from error

    def refuse_others(self) -> None:
        """Raise InputError if the document contains a key that was not looked up."""
        for key in _names(self.document):
            if not any(used == key or used.startswith(f"{key}.") for used in self.asked):
                short = key[:_MAX_CHARACTERS]
                nearest = difflib.get_close_matches(short, self.asked, n=1, cutoff=0.0)[0]
                raise InputError(
                    f"{self.path}: the key {short} is unknown, the nearest allowed is {nearest}"
                )

    def refuse(self, key: str, allowed: str) -> NoReturn:
        """Raise InputError with the key, its value and the allowed values."""
        raise InputError(
            f"{self.path}: {key} is {_SHORT_REPR.repr(self._value(key))}, allowed is {allowed}"
        )

    def _value(self, key: str) -> Any:
        self.asked.add(key)
        value = self._looked_up(key)
        if value is _MISSING:
            raise InputError(f"{self.path}: the key {key} is missing{self._misspelt(key)}")
        return value

    def _misspelt(self, key: str) -> str:
        """Name the unknown key that a missing one seems to be written as; "" if there is none."""
        before, _, last = key.rpartition(".")
        section = self._looked_up(before) if before else self.document
        if section is _MISSING:
            return self._misspelt(before)
        for name in section if isinstance(section, dict) else ():
            whole = f"{before}.{name}" if before else name
            if whole not in self.asked and _is_misspelt(name, last):
                return f", and {whole[:_MAX_CHARACTERS]} is unknown"
        return ""

    def _looked_up(self, key: str) -> Any:
        """Return the value of a dotted key, `_MISSING` if there is none."""
        value, before = self.document, ""
        for part in key.split("."):
            if isinstance(value, list) and part.isdecimal():
                value = value[int(part)] if int(part) < len(value) else _MISSING
            elif isinstance(value, dict):
                value = value.get(part, _MISSING)
            elif before:
                self.refuse(before, "a section {...}")
            else:
                return _MISSING
            if value is _MISSING:
                return _MISSING
            before = f"{before}.{part}" if before else part
        return value

    def has(self, key: str) -> bool:
        """Return whether the document contains a key."""
        self.asked.add(key)
        return self._looked_up(key) is not _MISSING

    def number(self, key: str, low: float, high: float) -> float:
        """Look up a finite number from `low` to `high`."""
        value = self._value(key)
        if not _is_number(value, low, high):
            self.refuse(key, f"a number from {low:g} to {high:g}")
        return float(value)

    def count(self, key: str, low: int, high: int) -> int:
        """Look up a whole number from `low` to `high`."""
        value = self._value(key)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            self.refuse(key, f"a whole number from {low} to {high}")
        return value

    def flag(self, key: str) -> bool:
        """Look up true or false."""
        value = self._value(key)
        if not isinstance(value, bool):
            self.refuse(key, "true or false")
        return value

    def one_of(self, key: str, *allowed: str | int) -> Any:
        """Look up one of the allowed texts or whole numbers."""
        value = self._value(key)
        if isinstance(value, bool) or value not in allowed:
            self.refuse(key, f"one of {', '.join(map(str, allowed))}")
        return allowed[allowed.index(value)]  # 1 where the file has 1.0

    def numbers(self, key: str, low: float, high: float, most: int) -> Floats:
        """Look up a list of at most `most` finite numbers (n,) from `low` to `high`."""
        value = self._value(key)
        if not (
            isinstance(value, list)
            and len(value) <= most
            and all(_is_number(item, low, high) for item in value)
        ):
            self.refuse(key, f"a list of at most {most} numbers from {low:g} to {high:g}")
        return np.array(value, dtype=np.float64)

    def matrix(self, key: str, low: float, high: float, size: int) -> Floats:
        """Look up a list of `size` lists of as many finite numbers (size, size)."""
        value = self._value(key)
        if not (
            isinstance(value, list)
            and len(value) == size
            and all(isinstance(row, list) and len(row) == size for row in value)
            and all(_is_number(item, low, high) for row in value for item in row)
        ):
            self.refuse(key, f"a list of {size} lists of {size} numbers from {low:g} to {high:g}")
        return np.array(value, dtype=np.float64)

    def pair(self, key: str, low: float, high: float) -> Floats:
        """Look up two finite numbers (2,) from `low` to `high`."""
        return self._vector(key, low, high, 2, "two")

    def triple(self, key: str, low: float, high: float) -> Floats:
        """Look up three finite numbers (3,) from `low` to `high`."""
        return self._vector(key, low, high, 3, "three")

    def _vector(self, key: str, low: float, high: float, size: int, name: str) -> Floats:
        value = self._value(key)
        if not (
            isinstance(value, list)
            and len(value) == size
            and all(_is_number(item, low, high) for item in value)
        ):
            self.refuse(key, f"a list of {name} numbers from {low:g} to {high:g}")
        return np.array(value, dtype=np.float64)

    def items(self, key: str, least: int, most: int) -> list[str]:
        """Look up a list of `least` to `most` sections; return the key of each."""
        value = self._value(key)
        if not (
            isinstance(value, list)
            and least <= len(value) <= most
            and all(isinstance(item, dict) for item in value)
        ):
            self.refuse(key, f"a list of {least} to {most} sections {{...}}")
        return [f"{key}.{i}" for i in range(len(value))]

    def file_name(self, key: str) -> str:
        """Look up the name of a file that is in the folder of the document."""
        value = self._value(key)
        plain = isinstance(value, str) and value.isprintable() and value not in ("", ".", "..")
        if not (plain and Path(value).name == value):
            self.refuse(key, "the name of a file in the same folder")
        return str(value)


def _is_misspelt(name: str, meant: str) -> bool:
    """Return whether a key's name seems to be another one, misspelt.

    A value and its sigma have similar names, but not the same number of words.
    """
    if name.count("_") != meant.count("_"):
        return False
    return bool(difflib.get_close_matches(name[:_MAX_CHARACTERS], [meant], cutoff=_SIMILAR))


def _section(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make a section of its keys and values. Raises ValueError for a key that is given twice."""
    section = dict(pairs)
    if len(section) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {twice[:_MAX_CHARACTERS]} is given twice in one section")
    return section


def _names(document: Any, prefix: str = "", depth: int = 3) -> Iterator[str]:
    """Yield every dotted key of a document, sections before their keys, to a depth of `depth`."""
    if isinstance(document, dict) and depth:
        for name, value in document.items():
            yield prefix + name
            yield from _names(value, f"{prefix}{name}.", depth - 1)
    elif isinstance(document, list):
        for i, item in enumerate(document):
            yield from _names(item, f"{prefix}{i}.", depth)


def _is_number(value: Any, low: float, high: float) -> bool:
    # A bool is an int in Python; the finite bounds exclude NaN and infinity.
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
