"""The comparisons of the clients find what differs; environments are installed once."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.instrument.errors import InputError
from tests.robustness.export_clients import command, environments
from tests.robustness.export_clients.clients import check
from tests.vbaa_bench.exports.written import Size, write_dataset
from vbaa_bench.exports.source import open_source

ROWS: check.Rows = {
    "a": {
        "pixels": "",
        "dtype": "uint16",
        "columns": {f"x{i}": v for i, v in enumerate([0.1, None, "text", [1.0, 2.5], True] * 5)},
    }
}


def test_pixels_are_compared_in_value_type_and_byte_order() -> None:
    image = np.array([[1, 300]], np.uint16)
    rows = {"a": ROWS["a"] | {"pixels": check.pixel_digest(image)}}

    def right(image: Any) -> list[bool]:
        return [one.right for one in check.pixels(rows, {"a": image})]

    assert right(image) == [True, True]
    assert right(image.astype(">u2")) == [True, True]
    assert right(image + np.uint16(1)) == [False, True]
    assert right((image >> 8).astype(np.uint8)) == [False, False]


@pytest.mark.parametrize(
    ("name", "value", "precision", "right"),
    [
        ("x0", 0.1, float, True),
        ("x0", np.float32(0.1), float, False),
        ("x0", np.float32(0.1), np.float32, True),
        ("x1", float("nan"), float, True),
        ("x1", [float("nan")] * 3, float, True),
        ("x1", 0.0, float, False),
        ("x2", "test", float, False),
        ("x3", [1.0, 2.0], float, False),
        ("x3", [1.0], float, False),
        ("x4", False, float, False),
    ],
)
def test_every_label_is_compared(name: str, value: Any, precision: Any, right: bool) -> None:
    loaded_rows = {"a": ROWS["a"]["columns"] | {name: value}}
    assert check.labels(ROWS, loaded_rows, precision).right == right
    del loaded_rows["a"][name]
    few = {"a": {key: loaded_rows["a"][key] for key in list(loaded_rows["a"])[:10]}}
    assert not check.labels(ROWS, few).right  # most columns are missing


def test_refusals_and_errors_are_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = write_dataset(tmp_path / "data", Size(bits=16))
    expected = tmp_path / "expected.jsonl"
    expected.write_text("".join(command._expected(open_source(data))), encoding="utf-8")
    frame = json.loads(expected.read_text(encoding="utf-8").splitlines()[0])
    assert frame["dtype"] == "uint16"
    assert frame["columns"]["x_c_mm"] is None or isinstance(frame["columns"]["x_c_mm"], float)
    lerobot = next(trial for trial in command._TRIALS if trial.client == "lerobot")
    (row,) = command._checks(data, lerobot, tmp_path / "out", expected, Path("none"))
    assert (row.asked, row.right) == ("refusal", True)
    assert row.measured.startswith("its images have 16 bits")
    failed = subprocess.CompletedProcess([], 1, "", "Traceback\nImportError: no such module")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    (row,) = command._checks(data, command._TRIALS[0], tmp_path / "hf", expected, Path("none"))
    assert (row.measured, row.right) == ("ImportError: no such module", False)
    assert "**wrong**" in command.as_markdown([row])


def test_a_client_runs_apart_from_this_project(tmp_path: Path) -> None:
    done = command._read_by_client(Path(sys.executable), "none", tmp_path, tmp_path)
    assert done.returncode == 1
    assert "IsADirectoryError" in done.stderr  # it began to read EXPECTED
    assert "__main__.py" in done.stderr
    assert str(environments.HERE) not in done.stderr


def test_an_environment_is_installed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = []

    def run(words: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        commands.append(words)
        (tmp_path / "clients").mkdir(exist_ok=True)
        return subprocess.CompletedProcess(words, 0, "", "")

    monkeypatch.setattr(subprocess, "run", run)
    environments.environment("clients", tmp_path)
    environments.environment("clients", tmp_path)
    assert len(commands) == 2
    assert commands[1][4:7] == ["install", "--quiet", "--no-deps"]
    (tmp_path / "clients" / "installed").write_text("other versions", encoding="utf-8")
    failed = subprocess.CompletedProcess([], 1, "", "no space left")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(InputError, match=r"clients: cannot be installed \(no space left\)"):
        environments.environment("clients", tmp_path)


def test_versions_are_pinned() -> None:
    for name in ("clients", "lerobot"):
        text = (environments.HERE / f"{name}.txt").read_text(encoding="utf-8")
        lines = [line for line in text.splitlines() if not line.startswith("#")]
        assert len(lines) > 40
        assert all("==" in line and "/" not in line for line in lines)
