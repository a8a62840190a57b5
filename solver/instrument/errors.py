"""Exceptions for unusable input, and short texts for their messages."""

from typing import Final

# Chosen: two lines of a terminal are enough to identify a value.
LONGEST_SHOWN: Final = 160


class InputError(Exception):
    """Error for a file, key or value that cannot be used; its text is one sentence for the user.

    Raise this if the mistake is outside the program and the user can correct it: the
    command lines print the sentence and exit with status 2. Characters that would control a
    terminal, or cannot be encoded, are escaped: the text may quote a file of unknown origin.
    """

    def __init__(self, message: str) -> None:
        super().__init__("".join(map(_printable, message)))


class IncompleteError(InputError):
    """Error for a source of images that ends too early: what it gave was used, the exit is 1."""


class DamageError(InputError):
    """Error for a file of a generated dataset that is missing, or is not what was written."""


def _printable(character: str) -> str:
    if character.isprintable() or character == "\n":
        return character
    return repr(character)[1:-1]


def quoted(value: object) -> str:
    """Quote a value for a message: on one line, a long value truncated."""
    try:
        return truncated(repr(value))
    except (RecursionError, ValueError):  # too deep, or a whole number of more than 4300 digits
        return f"of type {type(value).__name__}, and too large to be shown"


def truncated(text: str) -> str:
    """Put a text on one line, and truncate a long text."""
    line = " ".join(text[: 2 * LONGEST_SHOWN].split())
    return line if len(text) <= LONGEST_SHOWN else f"{line[:LONGEST_SHOWN]}..."
