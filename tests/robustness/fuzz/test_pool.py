"""Cases run in watched processes; those that misbehave are found, and stop no other."""

from pathlib import Path

import pytest

from tests.robustness.fuzz import child, pool
from tests.robustness.fuzz.case import Case, message_flaw
from tests.robustness.fuzz.child import Runner
from tests.robustness.fuzz.misbehaving import Fatal, Misbehaving


@pytest.fixture
def material(tmp_path: Path) -> Path:
    (tmp_path / "material").mkdir()
    return tmp_path / "material"


def test_every_kind_of_finding_is_found(
    material: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    child.reset_peak_memory()  # tests before this one may have needed more
    limit_mb = child.peak_memory_mb() + 200
    monkeypatch.setattr(child, "MEMORY_LIMIT_MB", limit_mb)
    runner = Runner({"x": Misbehaving}, 1, material, tmp_path / "work")
    results = [runner.run(Case("x", number)) for number in range(8)]
    assert [result.outcome for result in results] == [
        *("refused", "traceback", "message", "printed", "printed", "noisy", "memory", "accepted"),
    ]
    assert "KeyError: 'x'" in results[1].text
    assert results[2].text == "the message names no file: is wrong"
    assert results[6].memory_mb > limit_mb > results[7].memory_mb


def test_children_that_die_wait_or_write_are_replaced(
    material: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pool, "CLOCK_LIMIT_S", 0.5)
    monkeypatch.setattr(pool, "_GRACE_S", 0.5)
    kept: dict[Case, str] = {}

    def keep(finding: Case, folder: Path) -> None:
        kept[finding] = (folder / "input").read_text(encoding="utf-8")

    cases = [Case("x", number) for number in range(6)]
    results = dict(pool.run_all(cases, {"x": Fatal}, 1, material, tmp_path / "work", 2, keep))
    assert results.keys() == set(cases)
    outcomes = {"die": "died", "write": "outside", "wait": "hang"}
    assert {one: outcomes[what] for one, what in kept.items()} == {
        one: result.outcome for one, result in results.items() if result.outcome != "accepted"
    }
    assert set(kept.values()) == outcomes.keys()
    assert not any((tmp_path / "work").iterdir())


@pytest.mark.parametrize(
    ("message", "flaw"),
    [
        ("/case/a.yaml:1:1: seed is 'x', allowed is a number", ""),
        ("/material/baseline.json: is of another scene", ""),
        ("--set is 'x', allowed is KEY=VALUE", ""),
        ("seed is wrong", "names no file"),
        ("", "is empty"),
        ("/case: \x1b[31m", "has the characters '\\x1b'"),
        ("/case: \ud800", "has the characters '\\ud800'"),
        (f"/case: {'x' * 5000}", "has 5007 characters"),
    ],
)
def test_a_message_is_short_printable_and_names_its_file(message: str, flaw: str) -> None:
    found = message_flaw(message, Path("/case"), Path("/material"))
    assert flaw in found
    assert bool(found) == bool(flaw)
