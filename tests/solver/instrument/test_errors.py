"""Messages quote files of unknown origin."""

import pytest

from solver.instrument.errors import LONGEST_SHOWN, DamageError, InputError, cell_text, quoted


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


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("a tip outside of the image", "a tip outside of the image"),
        ('=HYPERLINK("http://a.example";"x")', '\'=HYPERLINK("http://a.example";"x")'),
        ("  +1", "'+1"),
        ("-1", "'-1"),
        ("@SUM(1)", "'@SUM(1)"),
        ("\x1b[2J\x1b]0;x\x07red", "\\x1b[2J\\x1b]0;x\\x07red"),
        ("two\nlines\tand a tab\r", "two lines and a tab"),
        ("\u202ereversed", "\\u202ereversed"),
    ],
)
def test_a_text_of_unknown_origin_is_made_fit_for_a_cell(text: str, cell: str) -> None:
    assert cell_text(text) == cell
    assert cell_text(cell) == cell
