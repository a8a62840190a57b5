"""Messages quote files of unknown origin."""

from solver.instrument.errors import LONGEST_SHOWN, DamageError, InputError, quoted


def test_what_controls_a_terminal_or_cannot_be_encoded_is_escaped() -> None:
    message = str(InputError("a.yaml: key \x1b[2J\u202e\ud800 is unknown\nbeam.ä is 3 µm"))
    assert message == "a.yaml: key \\x1b[2J\\u202e\\ud800 is unknown\nbeam.ä is 3 µm"
    assert str(DamageError("\x07")) == "\\x07"
    message.encode()


def test_a_value_that_cannot_be_written_is_quoted_by_its_type() -> None:
    deep: list[object] = []
    for _ in range(10_000):
        deep = [deep]
    assert quoted(deep) == "of type list, and too large to be shown"
    assert quoted(10**5000) == "of type int, and too large to be shown"
    assert quoted(["x" * 500]) == f"['{'x' * (LONGEST_SHOWN - 2)}..."
