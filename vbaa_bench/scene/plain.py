"""Conversion between plain values of Python and documents of the YAML parser, within limits."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from ruamel.yaml.comments import CommentedMap, CommentedSeq

from solver.instrument.errors import InputError

# Chosen: shipped scenes are four levels deep and have 100 values.
MAX_DEPTH: Final = 20
MAX_VALUES: Final = 10_000
# Python writes no whole number of more than 4300 digits, such as of thousands of digits in base 16.
MAX_BITS: Final = 14_000


def as_document(value: Any, path: Path, depth: int = 1) -> Any:
    """Convert mappings and sequences to the parser's types, without places in a file.

    Raises InputError for values that are nested too deeply; `path` is for the message.
    """
    if depth > MAX_DEPTH:
        raise InputError(f"{path}: is nested too deeply, allowed are {MAX_DEPTH} levels")
    if isinstance(value, Mapping):
        parts = {key: as_document(part, path, depth + 1) for key, part in value.items()}
        return CommentedMap(parts)
    if isinstance(value, list | tuple):
        return CommentedSeq([as_document(part, path, depth + 1) for part in value])
    return value


def too_deep(path: Path, line: int = 0) -> InputError:
    """Make the error for a file that is nested too deeply at a line, counted from 0."""
    return InputError(f"{path}:{line + 1}:1: is nested too deeply, allowed are {MAX_DEPTH} levels")


class Plain:
    """Converter of a parsed document to plain Python, with tuples for lists as in the models.

    An alias counts each time it is used: a few lines of aliases of aliases make millions of
    values. Raises InputError.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._values = path, 0

    def of(self, node: Any, depth: int = 1) -> Any:
        """Convert a part of the document, `depth` levels down."""
        self._values += 1
        if self._values > MAX_VALUES:
            raise InputError(f"{self._path}: holds too many values, allowed are {MAX_VALUES:,}")
        if depth > MAX_DEPTH:  # an alias within itself
            raise too_deep(self._path)
        if isinstance(node, CommentedMap):
            within_bits = self._within_bits
            return {within_bits(key): self.of(value, depth + 1) for key, value in node.items()}
        if isinstance(node, CommentedSeq):
            return tuple(self.of(value, depth + 1) for value in node)
        if isinstance(node, bool) or node is None:
            return node
        for plain_type in (int, float, str):
            if isinstance(node, plain_type):
                return plain_type(self._within_bits(node))
        return node

    def _within_bits(self, key: Any) -> Any:
        """Return a key or plain value. Raises InputError if it is too long a number."""
        if isinstance(key, int) and key.bit_length() > MAX_BITS:
            raise InputError(
                f"{self._path}: holds a whole number of {key.bit_length():,} bits, allowed are "
                f"{MAX_BITS:,}"
            )
        return key
