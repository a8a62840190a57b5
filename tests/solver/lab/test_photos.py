"""The command `photos`: drawn photographs in, a table, a page and JSON out."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from solver.__main__ import main
from solver.lab.photos_table import COLUMNS
from tests.command_line import CommandLine
from tests.draws import generator
from tests.photo_sets import Force, TrueBeam, TrueCamera, bent
from tests.photographed import Look, photograph_of

SIZE = (900, 600)
BEAM = TrueBeam(bow=(0.002, 0.0, 0.0))
LOADS = [None, Force("weight", 0.45, 0.36), Force("weight", 0.35, 0.3)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three drawn photographs of a beam of 6 px with four marks, and photos.json."""
    rng = generator(__name__, 7)
    photos: list[dict[str, Any]] = []
    for i, load in enumerate(LOADS):
        camera = TrueCamera(
            focal=800.0, roll=0.02 * i, view=(0.02, -0.01 * i), aim=(0.5, -0.15), size=SIZE
        )
        rows = bent(BEAM, load, 0.003 * i, np.linspace(0, BEAM.length, 4000)).rows
        line = camera.pixels(rows[:, :2], BEAM.length)
        drawn = photograph_of(line, 6.0, SIZE[::-1], Look(), rng)
        cv2.imwrite(str(tmp_path / f"{i}.png"), drawn.image.astype(np.uint8))
        places = np.array([[0.0, 0.05], [0.4, 0.05], [0.4, -0.1], [0.0, -0.1]])
        marks = camera.pixels(places, BEAM.length)
        photos.append(
            {
                "file": f"{i}.png",
                "clamp_px": line[0].tolist(),
                "tip_px": line[-1].tolist(),
                "marks": [
                    {"px": px.tolist(), "mm": (1e3 * place).tolist()}
                    for px, place in zip(marks, places, strict=True)
                ],
            }
        )
    photos[1]["load"] = {"kind": "weight", "force_n": 0.45, "force_sigma_n": 0.001}
    photos[2]["load"] = {"kind": "weight"}
    document = {
        "beam": {"length_mm": 400, "length_sigma_mm": 0.1},
        "down_deg": -90,
        "mark_sigma_px": 0.5,
        "photos": photos,
    }
    (tmp_path / "photos.json").write_text(json.dumps(document), encoding="utf-8")
    return tmp_path


@pytest.mark.thorough
def test_photographs_give_a_table_a_page_and_json(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    command = CommandLine(main, capfd)
    out, page = folder / "new" / "estimates.csv", folder / "page.html"
    ended = command("photos", folder, "--out", out, "--page", page, "--json")
    assert ended.status == 0, ended.err
    with out.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == COLUMNS
    assert [row["outcome"] for row in rows] == ["no contact", "contact", "contact"]
    for row, load in zip(rows, LOADS, strict=True):
        if load:
            off = float(row["s_c_mm"]) - 1e3 * load.at
            assert abs(off) < max(4 * float(row["s_c_sigma_mm"]), 0.5)
            assert float(row["force_n"]) == pytest.approx(load.size, rel=0.05)
    document = json.loads(ended.out)
    assert document["photos"][2]["force_n"] == pytest.approx(float(rows[2]["force_n"]))
    rigidity = document["shared"]["flexural_rigidity_n_mm2"]
    assert rigidity == pytest.approx(1e6 * BEAM.rigidity, rel=0.03)
    assert all(math.isfinite(value) for value in document["shared"].values())
    assert isinstance(document["cannot_be_known"], list)
    assert "in rendered photographs" in document["cannot_be_known"][-1]
    text = page.read_text(encoding="utf-8")
    assert text.count("<figure>") == 3
    assert "data:image/jpeg;base64," in text
    assert 'class="fit"' in text
    assert "http" not in text
    for label in ("EI at the clamp", "free length", "bow of the tip at rest", "focal length"):
        assert f"    {label}: " in text
    assert "_" not in text[text.index("<pre>") : text.index("</pre>")].replace("_c ", " ")


def test_mistakes_are_named(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    command = CommandLine(main, capfd)
    cv2.imwrite(str(folder / "1.png"), np.zeros((50, 60), np.uint8))
    assert "allowed is the size of" in command.refused("photos", folder)
    assert "a crop with principal_point_px" in command.refused("photos", folder)
    (folder / "1.png").unlink()
    assert "1.png" in command.refused("photos", folder)
    (folder / "photos.json").write_text("[]", encoding="utf-8")
    assert "the key photos is missing" in command.refused("photos", folder)
