"""What a command prints, as it is."""

import pytest

from vbaa_bench.console import hear, show_table


def test_a_table_is_whole_where_the_terminal_is_narrow(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    row = ("[/x]", *(f"{number}" * 30 for number in range(1, 6)))
    show_table("title", ("method", *"abcde"), [row])
    shown = capsys.readouterr().out
    assert all(cell in shown for cell in row)


def test_what_is_heard_is_no_markup(capsys: pytest.CaptureFixture[str]) -> None:
    hear("[/x] [bold]as it is[/bold]")
    assert capsys.readouterr().err == "[/x] [bold]as it is[/bold]\n"
