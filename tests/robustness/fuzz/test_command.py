"""The fuzz keeps its cases, and continues where it was interrupted."""

import json
from pathlib import Path
from typing import Any

import pytest

from solver.instrument.errors import InputError
from tests.robustness.fuzz import command
from tests.robustness.fuzz.command import fuzz, markdown, rows
from tests.robustness.fuzz.misbehaving import Misbehaving


def test_cases_are_kept_continued_and_summarised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "material").mkdir()
    monkeypatch.setattr(command, "KINDS", {"x": Misbehaving})
    out, reached = tmp_path / "out", list[tuple[str, int]]()

    def run(count: int, seed: int = 3) -> dict[str, Any]:
        return fuzz(
            {"x": count}, seed, tmp_path / "material", out, 1, lambda *at: reached.append(at)
        )

    run(1)
    record = run(3)  # in a new process, which begins its misbehaviour anew
    assert record["findings"] == 1
    assert rows(record)[0][:6] == ("x", "3", "0", "2", "0", "1 traceback")
    assert "| x | 3 | 0 | 2 | 0 | 1 traceback |" in markdown(record)
    assert reached == [("x", 1), ("x", 1), ("x", 2), ("x", 3)]
    assert "KeyError: 'x'" in (out / "findings" / "x_2" / "finding.txt").read_text()
    assert (out / "findings" / "x_2" / "input").is_file()

    path = out / "cases.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-1]) + lines[-1][:10])  # killed while it wrote
    assert run(3)["cases"] == 3
    assert [json.loads(line)[:2] for line in path.read_text().splitlines()[1:]] == [
        *(["x", 0], ["x", 1], ["x", 2]),
    ]
    with pytest.raises(InputError, match="is of seed 3; choose another folder"):
        run(3, seed=4)
    path.write_text("x")
    with pytest.raises(InputError, match="is not the list of cases of a fuzz"):
        run(3)
