"""What a person sees."""

import csv
import io
import time
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from solver.instrument.beam_shape import (
    FRICTION_SIGMA,
    SECTION_SIGMA,
    SOFTNESS_SIGMA,
    TAPER_SIGMA,
    BeamShape,
    stated_shape,
)
from solver.instrument.estimate import Estimate, Outcome
from solver.lab import console
from solver.lab.console import expected_accuracy, reasons, sentence, setting_up, short_names, table
from solver.lab.table import csv_text, row
from tests.simulated import rig


@pytest.mark.parametrize(
    ("paths", "short"),
    [
        (["/home/lab/2026/run/a.png", "/home/lab/2026/run/b.png"], ["a.png", "b.png"]),
        (["/lab/one/a.png", "/lab/two/a.png"], ["one/a.png", "two/a.png"]),
        (["/lab/a.png", "/lab/a.png"], ["a.png", "a.png"]),
        (["12", "13"], ["12", "13"]),
        ([], []),
    ],
)
def test_a_frame_is_called_by_what_tells_it_apart(paths: list[str], short: list[str]) -> None:
    assert short_names(paths) == short


def test_the_table_shows_short_names_as_they_are() -> None:
    names = ["/home/lab/a/very/long/way/down/[red]1.png", "/home/lab/a/very/long/way/down/2.png"]
    out = io.StringIO()
    nothing = Estimate(Outcome.NO_CONTACT)
    shown = table([row(name, nothing, 1.5) for name in names], "mine[/x]:f")
    Console(file=out, width=120).print(shown)
    text = out.getvalue()
    assert "/home" not in text
    for part in ("[red]1.png", "2.png", "no contact", "mine[/x]:f"):
        assert part in text


def test_every_reason_is_said_once() -> None:
    dark = Estimate(Outcome.INVALID, "the image is black")
    rows = [row(name, dark, 1.0) for name in "abc"] + [row("d", Estimate(Outcome.NO_CONTACT), 1.0)]
    values = Estimate(Outcome.CONTACT, values={"x_c_m": 0.1, "force_n": 0.2})
    first, second = reasons([*rows, row("e", values, 1.0)])
    assert first == "3 frames: invalid: the image is black"
    assert second.startswith("1 frame: no contact: ")
    alone = replace(values, message="from this frame alone: no motor angle is read")
    remarked = [row(name, alone, 1.0) for name in "fg"]
    assert reasons(remarked) == ["2 frames: from this frame alone: no motor angle is read"]
    each = [row(str(n), replace(dark, message=f"{n} px off"), 1.0) for n in range(9)]
    assert reasons(each)[6:] == ["3 more messages are in the table that is written"]


def drawn_wire() -> BeamShape:
    """Return the shape of a beam that was not learned."""
    stated = stated_shape(TAPER_SIGMA, SOFTNESS_SIGMA, SECTION_SIGMA, FRICTION_SIGMA)
    return replace(stated, rigidity_sigma=0.024)


def test_only_what_is_not_learned_yet_is_named() -> None:
    """`learn` changes the beam and leaves EI; a hung weight gives EI and leaves the beam."""
    drawn, values = rig(), Estimate(Outcome.CONTACT, values={"x_c_m": 0.1, "force_n": 0.2})
    rows = [row("a", values, 1.0)]

    def line(relative: float, shape: BeamShape) -> str:
        rigidity = relative * drawn.beam.flexural_rigidity
        tolerances = replace(drawn.tolerances, flexural_rigidity=rigidity)
        (text,) = expected_accuracy(rows, replace(drawn, tolerances=tolerances, shape=shape))
        return text

    learned = replace(drawn_wire(), widths=np.array([0.01]))
    assert line(0.03, learned).endswith("; not learned yet: EI: step 5 of solver/README.md")
    assert line(0.005, drawn_wire()).endswith(
        "; not learned yet: the beam: step 6 of solver/README.md"
    )
    # EI in other planes than that of the pushes stays unknown.
    assert line(0.005, learned).endswith("(one sigma, of EI in rig.json)")


def test_the_first_force_says_what_accuracy_to_expect() -> None:
    """The rig states EI to 3 %, and to 2.4 % because the section's direction is unknown."""
    drawn, values = rig(), Estimate(Outcome.CONTACT, values={"x_c_m": 0.1, "force_n": 0.2})
    tolerances = replace(drawn.tolerances, flexural_rigidity=0.03 * drawn.beam.flexural_rigidity)
    stated = replace(drawn, tolerances=tolerances, shape=drawn_wire())
    (line,) = expected_accuracy([row("a", values, 1.0)], stated)
    assert line.startswith("expect forces within 3.8 %")
    assert line.endswith("; not learned yet: EI: step 5, the beam: step 6 of solver/README.md")
    nothing = Estimate(Outcome.NO_CONTACT)
    assert expected_accuracy([row("a", nothing, 1.0)], stated) == []
    tolerances = replace(tolerances, flexural_rigidity=0.005 * drawn.beam.flexural_rigidity)
    learned = replace(drawn, tolerances=tolerances)
    assert expected_accuracy([row("a", values, 1.0)], learned) == []


@pytest.mark.thorough
def test_a_first_start_shows_how_many_functions_are_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out, compiled = io.StringIO(), set[str]()
    monkeypatch.setattr(console, "console", Console(file=out, width=120, force_terminal=True))
    monkeypatch.setattr(console, "compiled_functions", lambda: compiled)
    monkeypatch.setattr(console, "is_first_start", lambda: True)
    with setting_up(quiet=False):
        compiled |= {f"module.function_{i}" for i in range(30)}
        time.sleep(1.2)  # more than two intervals at which they are counted
    assert "30/?" in out.getvalue()
    assert "30/30" in out.getvalue()


def test_a_later_start_shows_no_count(monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.StringIO()
    monkeypatch.setattr(console, "console", Console(file=out, width=120, force_terminal=True))
    monkeypatch.setattr(console, "is_first_start", lambda: False)
    with setting_up(quiet=False):
        pass
    assert "calibrating" in out.getvalue()
    assert "compiling" not in out.getvalue()


def test_a_message_reaches_neither_terminal_nor_spreadsheet_as_a_command() -> None:
    hostile = Estimate(Outcome.INVALID, "=HYPERLINK(1)\x1b[2J")
    cells = row("a\x1b[2J.png", hostile, None)
    out = io.StringIO()
    Console(file=out, width=120).print(table([cells], "mine"))
    assert "\x1b" not in out.getvalue() + sentence(cells)
    # What a method sends through a pipe is such a row, too.
    (line,) = csv.DictReader(io.StringIO(csv_text([cells | {"message": hostile.message}])))
    assert line["message"] == "'=HYPERLINK(1)\\x1b[2J"
