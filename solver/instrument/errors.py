"""Exceptions for unusable input, and short texts for their messages."""

from typing import Final

# Chosen: two lines of a terminal are enough to identify a value.
LONGEST_SHOWN: Final = 160


class InputError(Exception):
    """Error for a file, key or value that cannot be used; its text is one sentence for the user.

    Raise this if the mistake is outside the program and the user can correct it: the
    command lines print the sentence and exit with status 2.
    """


class DamageError(InputError):
    """Error for a file of a generated dataset that is missing, or is not what was written."""


def quoted(value: object) -> str:
    """Quote a value for a message: on one line, a long value truncated."""
    return truncated(repr(value))


def truncated(text: str) -> str:
    """Put a text on one line, and truncate a long text."""
    line = " ".join(text[: 2 * LONGEST_SHOWN].split())
    return line if len(text) <= LONGEST_SHOWN else f"{line[:LONGEST_SHOWN]}..."
