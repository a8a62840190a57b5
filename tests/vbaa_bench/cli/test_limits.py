"""The command limits of a scene; end_to_end/ has that of datasets."""

import json
from pathlib import Path

import polars as pl
import pytest

from tests.command_line import CommandLine
from vbaa_bench import cli
from vbaa_bench.limits import maps
from vbaa_bench.workers.jobs import SameProcess
from vbaa_bench.workers.pool import Pool

FEW = ("--contact-distance-pct", "50", "--deflection-pct", "5,10")


@pytest.fixture
def command(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, variant: str
) -> CommandLine:
    monkeypatch.setattr(maps, "Pool", SameProcess)
    monkeypatch.setattr("vbaa_bench.api.data.usable_variant", lambda _requested: variant)
    return CommandLine(cli.main, capfd)


@pytest.mark.thorough
def test_a_scene_is_answered_as_table_page_and_csv(
    command: CommandLine, small_scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(maps, "Pool", Pool)  # once with a process of its own
    page, csv = tmp_path / "new" / "page.html", tmp_path / "places.csv"
    designs = ("--vary", "beam.diameter_mm=0.4,0.8", "--vary", "camera.focal_length_px=700,3000")
    required = ("--require", "x_c_pct_L=0.1", "--require", "force_mn=0.0001")
    words = (
        "limits",
        small_scene,
        *FEW,
        *designs,
        *required,
        "--out",
        page,
        "--csv",
        csv,
        "--workers",
        "1",
    )
    ended = command(*words)
    assert ended.status == 0, ended.err
    assert "diameter_mm 0.8" in ended.out
    assert "impossible" in ended.out
    assert "does not see the whole board" in ended.err
    assert "force ≤ 0.0001 mN: at no place." in ended.out
    assert f"page: {page}" in ended.out
    assert "<h3" in page.read_text(encoding="utf-8")
    places = pl.read_csv(csv)
    assert places.height == 2 * 2
    assert places["x_c_limit_pct_L"].is_between(0.001, 0.1).all()


def test_numbers_are_one_object(command: CommandLine, small_scene: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    ended = command(
        *("limits", small_scene, *FEW, "--information", "planar", "--seed", "5", "--json"),
        *("--require", "x_c_mm=0.2,s_c_mm=0.00001", "--out", page),
    )
    record = json.loads(ended.out)
    assert record["requirements"] == ["x_c ≤ 0.2 mm", "s_c ≤ 1e-05 mm"]
    (design,) = record["designs"]
    assert (design["design"], design["reached"]) == ("small", 2)
    assert design["fulfilled"] == [1.0, 0.0]
    assert [place["deflection_pct"] for place in record["places"]] == [5.0, 10.0]
    assert {place["information"] for place in record["places"]} == {"planar"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--information", "rumour"), "--information: information 'rumour' is unknown"),
        (("--require", "x_c=1"), "--require is 'x_c=1', allowed is NAME=NUMBER"),
        (("--deflection-pct", "5,deep"), "--deflection-pct is '5,deep', allowed are numbers"),
        (("--set", "beam.length_mm=long"), "beam.length_mm is 'long'"),
        (("--vary", "beam.length_mm"), "--vary is 'beam.length_mm', allowed is KEY=VALUE"),
    ],
)
def test_mistakes_are_one_sentence(
    command: CommandLine,
    small_scene: Path,
    tmp_path: Path,
    words: tuple[str, str],
    message: str,
) -> None:
    page = tmp_path / "page.html"
    assert message in command.refused("limits", small_scene, "--out", page, *words)
    assert not page.exists()


def test_a_missing_scene_is_one_sentence(command: CommandLine, tmp_path: Path) -> None:
    message = command.refused("limits", tmp_path / "none.yaml")
    assert "none.yaml: is neither a file nor a shipped scene" in message
