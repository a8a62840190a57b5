"""The example of the page on datasets runs."""

import re
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[2] / "docs/dataset.md"


def test_the_table_of_all_frames_has_them_all(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("runs").mkdir()
    Path("runs/quickstart").symlink_to(dataset)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    frames = names["frames"]
    assert frames.height == 4
    assert {"file_name", "motor_angle_deg", "x_c_mm", "force_n"} <= set(frames.columns)
    assert all(
        (Path(file).parent / name).is_file() for file, name in frames["file", "file_name"].rows()
    )
