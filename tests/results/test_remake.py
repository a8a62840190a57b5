"""Folders of results: each is made again by one command, which records what it was made with."""

import json
import subprocess
from pathlib import Path

import pytest

from results.remake import RECORD, SCRIPT, note_of, remake
from solver.instrument.errors import InputError
from tests.command_words import calls

ROOT = Path(__file__).parents[2]
FOLDERS = sorted(path.parent for path in (ROOT / "results").glob("*/README.md"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
def test_a_folder_of_results_is_made_again_by_one_command(folder: Path) -> None:
    assert note_of(folder) in (folder / "README.md").read_text(encoding="utf-8")
    script = folder / SCRIPT
    subprocess.run(["bash", "-n", script], check=True)
    text = script.read_text(encoding="utf-8")
    assert [mistake for call in calls(text) if (mistake := call.mistake())] == []
    if (folder / RECORD).exists():
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        assert {"version", "commit", "datasets_made_with", "machine"} <= record.keys()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of results with a README and an earlier table."""
    folder = tmp_path / "results" / "mine"
    folder.mkdir(parents=True)
    (folder / "table.csv").write_text("earlier\n")
    return folder


def test_files_are_replaced_and_what_made_them_is_recorded(folder: Path, tmp_path: Path) -> None:
    identity = {"made_with": {"variant": "llvm_ad_mono", "target": "x86-64-v3, width 8"}}
    (folder / SCRIPT).write_text(
        'mkdir -p "$RUNS/data/truth" "$OUT/small"\n'
        f"echo '{json.dumps(identity)}' > \"$RUNS/data/truth/identity.json\"\n"
        'cat "$FROM/table.csv" results/mine/table.csv > "$OUT/table.csv"\n'
        'echo "# Mine" > "$OUT/README.md"\n'
        'vbaa-bench --version > "$OUT/small/version.txt"\n'
    )
    record = remake(folder, tmp_path / "work")
    assert (folder / "table.csv").read_text() == "earlier\n" * 2
    assert (folder / "README.md").read_text() == f"# Mine\n{note_of(folder)}"
    assert (folder / "small" / "version.txt").read_text() == f"{record['version']}\n"
    assert record["datasets_made_with"] == identity["made_with"]
    assert json.loads((folder / RECORD).read_text()) == record


@pytest.mark.parametrize(
    ("end", "limit_s", "message"),
    [("false", 60.0, "exit status 1"), ("sleep 600", 0.2, "did not end within")],
)
def test_a_script_that_fails_replaces_nothing(
    folder: Path, tmp_path: Path, end: str, limit_s: float, message: str
) -> None:
    (folder / SCRIPT).write_text(f'echo new > "$OUT/table.csv"\n{end}\n')
    with pytest.raises(InputError, match=message):
        remake(folder, tmp_path / "work", limit_s)
    assert (folder / "table.csv").read_text() == "earlier\n"
    assert not (folder / RECORD).exists()
    with pytest.raises(InputError, match=r"holds no remake\.sh"):
        remake(tmp_path, tmp_path / "work")
