"""What a command prints, as it is."""

import pytest

from solver.instrument.errors import InputError
from vbaa_bench.report.console import print_line, show_table
from vbaa_bench.scoring.results_layout import run_name


def test_a_table_is_whole_where_the_terminal_is_narrow(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for width in range(1, 20):
        row = ("[/x]", *(f"{number}" * width for number in range(1, 7)))
        show_table("title", ("method", "a long head, % of L", *"bcdef"), [row])
        shown = capsys.readouterr().out
        assert all(cell in shown for cell in (*row, *"bcdef"))


def test_what_is_heard_is_no_markup(capsys: pytest.CaptureFixture[str]) -> None:
    print_line("[/x] [bold]as it is[/bold] :smile:")
    assert capsys.readouterr().err == "[/x] [bold]as it is[/bold] :smile:\n"


def test_a_method_names_a_file_beside_the_others() -> None:
    assert run_name("mine:best", "area_weighted") == "mine.best@area_weighted"
    for name in ("../../mine:best", "[/x]"):
        with pytest.raises(InputError, match="is not a name or package"):
            run_name(name)
