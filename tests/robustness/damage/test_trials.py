"""Trials of damage find a command that uses a damaged file, and accept one that refuses it."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.draws import generator
from tests.robustness.damage import page, readers, trials
from tests.robustness.damage.__main__ import app
from tests.robustness.damage.damages import DAMAGES, kind_of
from tests.robustness.damage.trials import CRASHED, REFUSED, SAME, SILENT, run_trials
from vbaa_bench.workers.jobs import SameProcess


def careless(root: Path) -> str:
    """Use every board view without a check; end with a traceback without a manifest."""
    views = sorted((root / "observations" / "calibration").glob("*.png"))
    size = len((root / "truth" / "manifest.json").read_bytes())
    return f"{size} {[path.read_bytes()[-20:] for path in views]}"


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trials, "Pool", SameProcess)
    chosen = {
        "open_truth": readers.READERS["open_truth"],
        "solve": readers.READERS["solve"],
    }
    for module in (trials, page):
        monkeypatch.setattr(module, "READERS", chosen)


@pytest.mark.usefixtures("quick")
def test_the_commands_of_this_program_pass(dataset: Path, tmp_path: Path) -> None:
    kinds = {kind_of(path.relative_to(dataset).as_posix()) for path in dataset.rglob("*.*")}
    files = {kind for kind in kinds if not kind.endswith("_*")}
    count = len(files) * len(DAMAGES)
    out = tmp_path / "damage.md"
    options = ["--trials", str(count), "--work", str(tmp_path / "work"), "--out", str(out)]
    done = CliRunner().invoke(app, [str(dataset), *options, "--json"])
    record = json.loads(done.stdout)
    assert done.exit_code == 0, [row for row in record["rows"] if not row["named by verify"]]
    assert record["passed"]
    assert {row["kind of file"] for row in record["rows"]} == files
    assert all(row["trials"] == row["named by verify"] == 1 for row in record["rows"])
    for row in record["commands"]:
        assert row[SAME] > 0
        assert row[REFUSED] > 0
    assert f"| `verify` names every damaged file | {count} of {count} |" in out.read_text()
    assert out.with_suffix(".csv").is_file()
    # An interrupted measurement goes on, with the same trials.
    again = run_trials(dataset, tmp_path / "work", count, 1, 1, lambda _done, _total: None)
    fresh = run_trials(dataset, tmp_path / "fresh", 9, 1, 1, lambda _done, _total: None)
    assert again[:9] == fresh


@pytest.mark.usefixtures("quick")
def test_a_careless_command_is_found(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trials, "READERS", {"careless": careless})
    done = run_trials(dataset, tmp_path, 4 * 16, 1, 1, lambda _done, _total: None)
    outcomes = {(one.kind, one.damage): one.outcomes["careless"] for one in done}
    assert outcomes["observations/calibration/view_*.png", "truncate"] == SILENT
    assert outcomes["observations/calibration/view_*.png", "delete"] == SILENT
    assert outcomes["truth/manifest.json", "delete"] == CRASHED
    assert outcomes["truth/shard_*/truth.parquet", "flip"] == SAME
    assert not page.passed(done)


def test_damages_change_a_file(tmp_path: Path) -> None:
    for name, damage in DAMAGES.items():
        path = tmp_path / "a.csv"
        path.write_bytes(b"0123456789")
        damage(path, generator(__name__, 3))
        content = path.read_bytes() if path.is_file() else None
        assert content != b"0123456789", name
        assert (len(content) == 10) == (name == "flip") if content is not None else True
    assert kind_of("truth/shard_00012/ab12cd34ab12cd34.exr") == "truth/shard_*/*.exr"
    assert kind_of("predictions/mine.csv") == "predictions/*.csv"
