"""The table over several datasets, and what is said below it."""

import json
import re
from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.sealing import reseal
from tests.vbaa_bench.scoring.worlds import FREE, MANIFEST, truth
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.accuracy import accuracy
from vbaa_bench.scoring.frame_scores import score_frames
from vbaa_bench.scoring.predictions import checked_predictions
from vbaa_bench.scoring.remarks import remarks
from vbaa_bench.scoring.tables import Shown, csv_table, latex, markdown

SCENES = Path(__file__).parents[3] / "scenes"


def scene(name: str) -> dict[str, object]:
    dumped: dict[str, object] = load_scene(SCENES / name).scene.model_dump(mode="json")
    return dumped


def written(root: Path, true: Truth, scores: pl.DataFrame, of: str) -> Path:
    """A dataset's folder with nothing in it but its truth and its scores."""
    (root / "scores").mkdir(parents=True)
    scores.write_parquet(root / "scores" / "scores.parquet")
    (root / "truth" / "shard_00000").mkdir(parents=True)
    true.frames.write_parquet(root / "truth" / "shard_00000" / "truth.parquet")
    manifest = {**MANIFEST, "scene": scene(of)}
    (root / "truth" / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    (root / "observations").mkdir()
    reseal(Layout(root))
    return root


@pytest.fixture
def scored(tmp_path: Path) -> Path:
    """Two methods on three frames at two deflections and one free frame."""
    true = truth({}, {"push": "20 %"}, {"push": "20 %"}, {**FREE, "push": "-3°"})
    rows: dict[str, list[float | str]] = {
        "good": [120.24, 120.24, 119.76, "no contact"],
        "bad": [130.0, 130.0, "crashed", 110.0],
    }
    scores = []
    for name, answers in rows.items():
        table = pl.DataFrame(
            {
                "frame_id": [f"f{i}" for i in range(4)],
                "x_c_mm": [None if isinstance(said, str) else said for said in answers],
                "x_c_sigma_mm": [None if isinstance(said, str) else 0.3 for said in answers],
                "outcome": [said if isinstance(said, str) else None for said in answers],
            }
        )
        scores.append(score_frames(true, checked_predictions(table, name), name, name))
    return written(tmp_path / "taper", true, pl.concat(scores), "hard/taper.yaml")


def test_a_row_for_every_dataset_and_method(scored: Path) -> None:
    good, bad = accuracy([scored])
    assert (good["scene"], good["method"], good["n"]) == ("taper", "good", 4)
    assert good["x_c_rmse_pct_L"] == pytest.approx(0.1)
    assert (good["x_c_within_3_sigma_pct"], good["consistent_pct"]) == (100, 100)
    assert good["x_c_sigma_over_rmse"] == pytest.approx(0.3 / 0.24)
    assert (bad["x_c_within_3_sigma_pct"], bad["consistent_pct"]) == (0, 0)
    assert bad["outcomes"] == {"contact": 3, "crashed": 1}
    assert "tapered" in good["remark"]


def test_rows_by_a_condition_come_in_its_order(scored: Path) -> None:
    rows = accuracy([scored], "push")
    assert [(row["push"], row["method"], row["n"]) for row in rows] == [
        ("-3°", "good", 1),
        ("-3°", "bad", 1),
        ("10 %", "good", 1),
        ("10 %", "bad", 1),
        ("20 %", "good", 2),
        ("20 %", "bad", 2),
    ]
    with pytest.raises(InputError, match="'colour' is unknown, allowed is one of push"):
        accuracy([scored], "colour")


def test_conditions_that_differ_in_the_last_digit_are_one(scored: Path) -> None:
    path = scored / "scores" / "scores.parquet"
    scores = pl.read_parquet(path)
    off = pl.col("deflection_pct") * (1 + 1e-14 * pl.int_range(pl.len()))
    scores.with_columns(deflection_pct=pl.lit(5.0)).with_columns(off).write_parquet(path)
    rows = accuracy([scored], "deflection_pct")
    assert [(row["deflection_pct"], row["n"]) for row in rows] == [(5.0, 4), (5.0, 4)]


def test_stiffness_is_gathered_by_decades_and_told_at_the_end_of_a_push(tmp_path: Path) -> None:
    soft = [
        {"push_id": "soft", "step": step, "k_s_n_m": 10.0, "k_s_over_k_beam": ratio}
        for step, ratio in enumerate((0.02, 0.05))
    ]
    hard = {"push_id": "hard", "k_s_n_m": 1000.0, "k_s_over_k_beam": 10.0}
    true = truth(*soft, hard, {"push_id": "rigid"}, FREE)
    table = pl.DataFrame(
        {
            "frame_id": [f"f{i}" for i in range(5)],
            "x_c_mm": [120.0, 120.0, 120.0, 120.0, None],
            "compliance_mm_per_n": [150.0, 102.0, 1.2, 0.05, None],
            "compliance_sigma_mm_per_n": [1.0, 1.0, 0.01, 0.02, None],
            "outcome": [None, None, None, None, "no contact"],
        }
    )
    scores = score_frames(true, checked_predictions(table, "mine"), "mine", "mine")
    root = written(tmp_path / "stiff", true, scores, "fig8_rigid.yaml")
    keys = (
        "compliance_last_rmse_pct",
        "compliance_rigid_last_rmse_mm_per_n",
        "compliance_last_within_3_sigma_pct",
    )
    rows = {
        row["k_s_over_k_beam"]: [row[key] for key in keys]
        for row in accuracy([root], "k_s_over_k_beam")
    }
    assert list(rows) == ["0.01 – 0.1", "10 – 100", "rigid", None]
    assert rows["0.01 – 0.1"] == [pytest.approx(2.0), None, 100]
    assert rows["10 – 100"] == [pytest.approx(20.0), None, 0]
    assert rows["rigid"] == [None, pytest.approx(0.05), 100]
    assert rows[None] == [None, None, None]
    assert [row["k_s_n_m"] for row in accuracy([root], "k_s_n_m")] == ["10", "1000", "rigid", None]


def test_the_markdown_is_a_table_with_remarks_below(scored: Path) -> None:
    text = markdown(accuracy([scored, scored]), Shown())
    lines = text.splitlines()
    widths = {line.count("|") for line in lines[:6]}
    assert len(widths) == 1
    assert lines[2].startswith("| taper | good | 0.1 |")
    assert "psi" not in lines[0]  # nobody answers it
    assert lines[4].startswith("| taper | good |")
    assert lines[6] == ""
    assert [line for line in lines[7:] if "tapered" in line] == lines[7:]


def test_the_bound_is_a_row_after_the_methods(scored: Path) -> None:
    path = scored / "scores" / "scores.parquet"
    scores = pl.read_parquet(path)
    limits = {"x_c_limit_mm": 0.12, "force_limit_n": 0.002}
    scores.with_columns(**{name: pl.lit(value) for name, value in limits.items()}).write_parquet(
        path
    )
    rows = accuracy([scored], "push")
    bounds = [row for row in rows if row["method"] == "bound (image)"]
    assert [(row["push"], row["n"]) for row in bounds] == [("10 %", 1), ("20 %", 2)]
    assert bounds[1]["x_c_rmse_pct_L"] == pytest.approx(0.05)
    assert bounds[1]["force_rmse_pct"] == pytest.approx(2)
    assert bounds[1]["psi_rmse_deg"] is None
    good = next(row for row in rows if (row["push"], row["method"]) == ("20 %", "good"))
    assert good["x_c_rmse_over_limit"] == pytest.approx(2)
    assert good["x_c_bias_over_limit"] == pytest.approx(0, abs=1e-9)
    assert good["x_c_efficiency_pct"] == pytest.approx(25)
    assert "| taper | 20 % | bound (image) | 0.05 |" in markdown(rows, Shown("push"))


def test_latex_is_a_tabular_with_escaped_texts(scored: Path) -> None:
    rows = [row | {"scene": "50%_{a}\\b"} for row in accuracy([scored])]
    lines = latex([*rows, *accuracy([scored])], Shown()).splitlines()
    assert lines[0].startswith(r"\begin{tabular}{llr")
    assert lines[1::2][:2] == [r"\toprule", r"\midrule"]
    end = lines.index(r"\end{tabular}")
    assert lines[end - 1] == r"\bottomrule"
    assert all(line.startswith("% ") for line in lines[end + 1 :])
    columns = len(lines[0].rpartition("{")[2].rstrip("}"))
    body = [line for line in lines[2:end] if not line.endswith("rule")]
    assert len(body) == 5
    for line in body:
        assert line.endswith(r" \\")
        assert len(re.findall(r"(?<!\\)&", line)) == columns - 1
        assert re.search(r"(?<!\\)[%_#]", line) is None
    assert body[1].startswith(r"50\%\_\{a\}\textbackslash{}b & good & 0.1 &")


def test_csv_has_every_number_under_its_key(scored: Path) -> None:
    rows = accuracy([scored])
    table = pl.read_csv(csv_table(rows, Shown()).encode())
    assert table["method"].to_list() == ["good", "bad"]
    assert table["x_c_rmse_pct_L"][0] == rows[0]["x_c_rmse_pct_L"]
    assert table["outcomes"][1] == "3 contact, 1 crashed"
    assert "calibration" not in table.columns


def test_what_is_not_scored_or_was_scored_long_ago_is_refused(scored: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no scores"):
        accuracy([tmp_path / "none"])
    table = scored / "scores" / "scores.parquet"
    complete = pl.read_parquet(table)
    for column in ("consistent", "force_y_error_in_sigmas"):
        complete.drop(column).write_parquet(table)
        with pytest.raises(InputError, match="score the dataset again"):
            accuracy([scored])
    for wrong, message in (
        (complete.clear(), "has no rows"),
        (complete.with_columns(snr=pl.lit(1e300)), "snr is not finite, or above"),
        (complete.with_columns(pl.lit(float("inf")).alias("factor.x")), r"factor\.x is not finite"),
        (complete.with_columns(x_c_limit_mm=pl.lit(0.0)), "x_c_limit_mm is not above 1e-30"),
        (complete.with_columns(snr=pl.lit([1.0])), "snr holds List"),
    ):
        wrong.write_parquet(table)
        with pytest.raises(InputError, match=message):
            accuracy([scored])
    table.write_bytes(b"no table")
    with pytest.raises(InputError, match="is not a Parquet table"):
        accuracy([scored])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("hard/taper.yaml", "tapered"),
        ("hard/elliptic.yaml", "elliptic"),
        ("hard/stretch.yaml", "stretches"),
        ("hard/bow.yaml", "bow"),
        ("hard/gravity.yaml", "sag"),
        ("hard/own_weight.yaml", "motor angle"),
        ("hard/friction.yaml", "friction"),
        ("hard/moving_object.yaml", "moves by itself"),
        ("hard/two_pegs.yaml", "second peg"),
        ("hard/adaptor.yaml", "motor axis"),
        ("hard/hung_weight.yaml", "hangs"),
        ("hard/hung_weight.yaml", "clamp turns"),
        ("fig2_sliding_edge.yaml", "exact_fit_3d"),
        ("train_3d.yaml", "exact_fit_3d"),
        ("free_beam.yaml", "no contact"),
    ],
)
def test_a_scene_that_breaks_an_assumption_says_so(name: str, said: str) -> None:
    found = remarks(scene(name))
    assert any(said in sentence for sentence in found)


@pytest.mark.parametrize(
    "name", ["fig8_rigid", "quickstart", "hard/tiny_deflection", "va_flat_strip"]
)
def test_a_scene_that_keeps_them_says_nothing(name: str) -> None:
    assert remarks(scene(f"{name}.yaml")) == []
