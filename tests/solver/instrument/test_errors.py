"""Messages quote files of unknown origin."""

from solver.instrument.errors import DamageError, InputError


def test_what_controls_a_terminal_or_cannot_be_encoded_is_escaped() -> None:
    message = str(InputError("a.yaml: key \x1b[2J\u202e\ud800 is unknown\nbeam.ä is 3 µm"))
    assert message == "a.yaml: key \\x1b[2J\\u202e\\ud800 is unknown\nbeam.ä is 3 µm"
    assert str(DamageError("\x07")) == "\\x07"
    message.encode()
