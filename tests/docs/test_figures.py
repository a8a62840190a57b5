"""Figures of the pages' tables against the committed results that they were made from."""

import json
import re
from collections.abc import Callable, Iterator
from itertools import starmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import pytest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
# Deflections of Fig. 8.
PUSHES = ("5 %", "10 %", "20 %")
# Frames of a push of Fig. 11.
STEPS = 7
# From this signal-to-noise ratio on, the README counts detected contacts.
CLEAR_SNR = 60


class Figure(NamedTuple):
    """A figure as a page writes it, and its value in the results."""

    text: str
    value: float


class Table(NamedTuple):
    """A table: its first head with a text, whether a column holds figures only, and its rows."""

    head: str
    numeric: bool
    rows: list[list[str]]


def tables(text: str) -> list[Table]:
    """Tables of a Markdown page."""
    found = []
    for block in re.findall(r"(?:^\|.*\|$\n?)+", text, re.MULTILINE):
        heads, rule, *rows = [
            [cell.strip() for cell in line.strip().strip("|").split("|")]
            for line in block.strip().splitlines()
        ]
        found.append(Table(heads[0] or heads[1], any(cell.endswith(":") for cell in rule), rows))
    return found


def numbers(text: str) -> list[str]:
    """Numbers of a cell, as they are written."""
    return re.findall(r"\d[\d,]*(?:\.\d+)?", text)


def agrees(figure: Figure) -> bool:
    """Whether a figure is its value, rounded to the last place that is written."""
    written = figure.text.replace(",", "")
    unit = 10.0 ** -len(written.partition(".")[2])
    return abs(float(written) - figure.value) <= 0.5 * unit * (1 + 1e-9)


def named(cell: str) -> str:
    return cell.strip("`")


def scores(scene: str, method: str) -> dict[str, Any]:
    """Figures of a method in a scene, from the table of all scenes."""
    table = pl.read_csv(RESULTS / "scores" / "scores.csv", infer_schema_length=None)
    return table.row(
        by_predicate=(pl.col("scene") == scene) & (pl.col("method") == method), named=True
    )


def frames(scene: str, method: str) -> pl.DataFrame:
    """Errors of every frame of a method, from a baseline."""
    path = RESULTS / "baselines" / f"{scene}.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    return pl.DataFrame({**document["frames"], **document["methods"][method]})


def rms(errors: pl.Series) -> float:
    return float(np.sqrt(np.mean(errors.drop_nulls().to_numpy() ** 2)))


def figures(cell: str, *values: float) -> Iterator[Figure]:
    """Figures of a cell, in order, with their values."""
    return starmap(Figure, zip(numbers(cell), values, strict=True))


def of_method(file: str, method: str) -> dict[str, Any]:
    """Figures of a method, from a summary."""
    found: dict[str, Any] = json.loads((RESULTS / file).read_text(encoding="utf-8"))["methods"][
        method
    ]
    return found


def of_fig8(row: list[str]) -> Iterator[Figure]:
    """Median, RMSE at three deflections, RMSE over limit, force and time on the paper's rig."""
    method = named(row[0])
    values = of_method("fig8_rigid/summary.json", method)
    rows = frames("fig8_rigid", method)
    by_push = [rms(rows.filter(push=push)["x_c_error_pct_L"]) for push in PUSHES]
    yield from figures(row[1], values["x_c_median_abs_pct_L"])
    yield from figures(row[2], *by_push)
    yield from figures(row[3], values["x_c_rmse_over_limit"])
    yield from figures(row[4], values["force_rmse_pct"])
    yield from figures(row[5], values["ms_per_frame_median"])


def of_paper_centreline(row: list[str]) -> Iterator[Figure]:
    """RMSE of x_c at three deflections, on the paper's own centreline."""
    table = pl.read_csv(RESULTS / "fig8_rigid" / "by_push.csv", infer_schema_length=None)
    rows = table.filter(method=f"{named(row[0])}@area_weighted")
    by_push = dict(rows.select("push", "x_c_rmse_pct_L").iter_rows())
    yield from figures(row[1], *(by_push[push] for push in PUSHES))


def of_readme(row: list[str]) -> Iterator[Figure]:
    """Median of x_c, RMSE over limit, RMSE of the force, time."""
    values = of_method("fig8_rigid/summary.json", named(row[0].partition(",")[0]))
    columns = (
        "x_c_median_abs_pct_L",
        "x_c_rmse_over_limit",
        "force_rmse_pct",
        "ms_per_frame_median",
    )
    for cell, name in zip(row[1:], columns, strict=True):
        yield from figures(cell, values[name])


def of_experiment(row: list[str]) -> Iterator[Figure]:
    """RMSE of x_c and further figures of the paper's other experiments."""
    method = named(row[1])
    if row[0].startswith("Fig. 13"):
        hidden = frames("fig13_occlusion", method).filter(
            pl.col("hidden_place") != "tip", availability_asked=0.35
        )
        yield from figures(row[2], rms(hidden["x_c_error_pct_L"]))
        yield from figures(row[3], hidden["x_c_error_pct_L"].count(), hidden.height)
    elif row[0].startswith("Fig. 11"):
        pushes = frames("fig11_stiffness", method)
        ends = pushes.filter(pl.col("trial") % STEPS == STEPS - 1)
        yield from figures(row[2], rms(ends["x_c_error_pct_L"]))
        yield from of_springs(row[3], method)
    elif row[0].startswith("Free beam"):
        before = of_method("first_contact/before.json", method)
        free = before["free_frames"]
        yield from figures(row[0], free)
        yield from figures(row[3], before["false_contact_rate"] * free, free)
    elif row[0].startswith("First degree"):
        after = pl.read_csv(RESULTS / "first_contact" / "after.csv")
        clear = after.filter(pl.col("snr") >= CLEAR_SNR)
        detected = clear.filter(pl.col("x_c_error_pct_L").is_not_null())
        yield from figures(row[2], rms(clear["x_c_error_pct_L"]))
        yield from figures(row[3], detected.height, clear.height, CLEAR_SNR)
    elif row[0].startswith(("Fig. 9", "Fig. 6")):
        values = scores("fig9" if row[0].startswith("Fig. 9") else "fig6", method)
        yield from figures(row[2], values["x_c_rmse_pct_L"])
        yield from figures(row[3], values["psi_rmse_deg"], values["force_rmse_pct"])
    elif row[0].startswith("Section III-A"):
        values = scores("camera_fixed", method)
        yield from figures(row[2], values["x_c_rmse_pct_L"])
        yield from figures(row[3], 1e3 * values["motor_angle_rmse_deg"])
    elif row[0].startswith("Fig. 14"):
        values = scores("fig14", method)
        yield from figures(row[2], values["x_c_rmse_pct_L"])
        yield from figures(row[3], values["force_rmse_pct"])


def of_hard_scene(row: list[str]) -> Iterator[Figure]:
    """Figures of a scene that violates an assumption; its outcomes are compared as counts."""
    values = scores(named(row[0]), named(row[1]))
    columns = (
        "x_c_rmse_pct_L",
        "x_c_rmse_over_limit",
        "force_rmse_pct",
        "x_c_within_3_sigma_pct",
        "x_c_sigma_over_rmse",
        "consistent_pct",
    )
    for cell, name in zip(row[2:8], columns, strict=True):
        if cell == "–":
            assert values[name] is None, f"{row[0]}: {name}"
        else:
            yield Figure(cell, values[name])
    assert row[8] == values["outcomes"], row[0]


def of_springs(cell: str, method: str) -> Iterator[Figure]:
    """RMSE of the compliance at the end of a push, of two classes of springs."""
    table = pl.read_csv(RESULTS / "scores" / "fig11_by_stiffness.csv", infer_schema_length=None)
    rows = {row["k_s_over_k_beam"]: row for row in table.filter(method=method).to_dicts()}
    shares = re.findall(r"([\d.]+) %", cell)
    for share, springs in zip(shares, ("1 – 10", "10 – 100"), strict=True):
        yield Figure(share, rows[springs]["compliance_last_rmse_pct"])


def of_stress(row: list[str]) -> Iterator[Figure]:
    """Share answered, RMSE with its interval, share consistent, sigma / RMSE, share detected."""
    document = json.loads((RESULTS / "stress" / "stress.json").read_text(encoding="utf-8"))
    (found,) = (one["figures"] for one in document["rows"] if one["done"] == row[0])
    rmse = found["rmse"]
    columns = (
        [found["answered"]["value"]],
        [rmse["value"], rmse["low"], rmse["high"]],
        [found["consistent"]["value"]],
        [found["sigma_ratio"]["value"]],
        [found["detected"]["value"]],
    )
    for cell, values in zip(row[1:], columns, strict=True):
        if cell != "–":
            yield from figures(cell, *values)


def of_entrant(row: list[str]) -> Iterator[Figure]:
    """Median, 95th percentile and RMSE of x_c; median and RMSE of the force; time."""
    name = named(row[0])
    is_function = (ROOT / "docs" / "entrants" / name / f"{name}.py").is_file()
    values = of_method("entrants/summary.json", f"{name}.estimate" if is_function else name)
    columns = (
        "x_c_median_abs_pct_L",
        "x_c_p95_abs_pct_L",
        "x_c_rmse_pct_L",
        "force_median_abs_pct",
        "force_rmse_pct",
        "ms_per_frame_median",
    )
    return starmap(Figure, zip(row[1:], (values[name] for name in columns), strict=True))


def of_outline(row: list[str]) -> Iterator[Figure]:
    """Distances and shares of an object, from the page of the outlines."""
    scene = {"cam": "outline"}.get(row[0], f"outline_{row[0].partition(',')[0]}")
    (page,) = (
        table for table in tables((RESULTS / "outline" / "README.md").read_text(encoding="utf-8"))
    )
    (values,) = (one for one in page.rows if (named(one[0]), one[1]) == (scene, row[1]))
    texts = [*numbers(row[2]), row[3], row[4]]
    yield from map(Figure, texts, (float(values[k]) for k in (2, 3, 4, 6)))


def rungs(dataset: str) -> pl.DataFrame:
    """Figures of the rungs of the ladder, and their numbers."""
    table = pl.read_csv(RESULTS / "ladder" / "ladder.csv").filter(dataset=dataset)
    return table.with_row_index("number", 1)


def rung(dataset: str, name: str) -> dict[str, Any]:
    """Figures of a rung of the ladder, and its number."""
    return rungs(dataset).row(by_predicate=pl.col("rung") == name, named=True)


def of_rung(row: list[str]) -> Iterator[Figure]:
    """Median, RMSE at three deflections and of all, factor and share of a rung of the ladder."""
    number, _, name = row[0].partition(" ")
    values = rung("fig8_rigid", named(name))
    assert int(number) == values["number"]
    yield from figures(row[1], values["x_c_median_abs_pct_L"])
    yield from figures(row[2], *(values[f"x_c_rmse_pct_L_at_{one[:-2]}_pct"] for one in PUSHES))
    yield from figures(row[3], values["x_c_rmse_pct_L"])
    if int(number) > 1:
        yield from figures(row[4], values["divides_by"])
        assert row[5].startswith("−") == (values["share_pct"] < 0)
        yield from figures(row[5], abs(values["share_pct"]))


def of_drawn_rigs(row: list[str]) -> Iterator[Figure]:
    """Median and RMSE of a rung on a rig as drawn, and on rigs within their tolerances."""
    name = named(row[0])
    drawn = rung("drawn", name)
    yield from figures(row[3], drawn["answered"], drawn["frames"])
    for cells, values in ((row[1:3], rung("fig8_rigid", name)), (row[4:6], drawn)):
        yield from figures(cells[0], values["x_c_median_abs_pct_L"])
        yield from figures(cells[1], values["x_c_rmse_pct_L"])


def of_broken_assumption(row: list[str]) -> Iterator[Figure]:
    """RMSE of x_c or of the force, with a uniform, a stated and a learned beam."""
    page = (RESULTS / "learned_beam" / "README.md").read_text(encoding="utf-8")
    column = 11 if row[1].startswith("force") else 4
    scene = row[0].partition(":")[0]
    beams: dict[str, list[tuple[float, float]]] = {}
    here = beam = ""
    for line in tables(page)[0].rows:
        here, beam = line[0].partition(",")[0] or here, line[1] or beam
        if here == scene:
            beams.setdefault(beam, []).append((float(line[2]), float(line[column])))
    for cell, name in zip(row[2:], ("before", "as stated", "learned"), strict=True):
        counts = next((rows for beam, rows in beams.items() if beam.startswith(name)), None)
        if cell == "–":
            assert counts is None
        else:
            assert counts is not None
            frames, errors = np.transpose(counts)
            yield Figure(cell, float(np.sqrt(np.average(errors**2, weights=frames))))


SOURCES: dict[str, Callable[[list[str]], Iterator[Figure]]] = {
    "method": of_readme,
    "median error of x_c": of_fig8,
    "method, on the paper's centreline": of_paper_centreline,
    "experiment": of_experiment,
    "scene": of_hard_scene,
    "perturbation of the images or of `rig.json`": of_stress,
    "object": of_outline,
    "entrant": of_entrant,
    "rung": of_rung,
    "rung, on rigs": of_drawn_rigs,
    "broken assumption": of_broken_assumption,
}
PAGES = ("README.md", "docs/accuracy.md", "docs/entrants.md", "docs/ladder.md")
TABLES = [one for page in PAGES for one in tables((ROOT / page).read_text(encoding="utf-8"))]


@pytest.mark.parametrize("head", SOURCES)
def test_figures_of_the_pages_are_those_of_the_results(head: str) -> None:
    (table,) = (one for one in TABLES if one.head == head)
    wrong = []
    for row in table.rows:
        listed = list(SOURCES[head](row))
        assert listed, row[0]
        wrong += [(row[:2], *figure) for figure in listed if not agrees(figure)]
    assert wrong == []


def test_every_table_of_figures_has_a_source() -> None:
    assert {table.head for table in TABLES if table.numeric} <= SOURCES.keys()


def test_sentences_of_the_ladder_are_those_of_its_table() -> None:
    text = (ROOT / "docs" / "ladder.md").read_text(encoding="utf-8")
    of_5, of_20 = (f"x_c_rmse_pct_L_at_{deflection}_pct" for deflection in (5, 20))
    paper, mended, profile, linear, exact, _, light, _ = (
        row for row in rungs("fig8_rigid").iter_rows(named=True)
    )
    (errors,) = re.findall(r"square of the deflection: (.*?) %", text)
    by_push = (linear[f"x_c_rmse_pct_L_at_{one[:-2]}_pct"] for one in PUSHES)
    assert all(map(agrees, figures(errors, *by_push)))
    assert paper[of_20] < mended[of_20] < profile[of_20]  # "the errors at 20 % deflection rise"
    assert mended[of_5] / profile[of_5] == pytest.approx(7, abs=0.5)  # "falls to a seventh"
    assert exact["share_pct"] == pytest.approx(80, abs=2)  # "nearly four fifths of the whole way"
    drawn = rung("drawn", "clamp, calibration")
    assert drawn["divides_by"] == pytest.approx(9, abs=0.5)  # "divides the error by nine"
    assert agrees(Figure("0.01", light["x_c_median_abs_pct_L"]))
    assert rung("fig8_rigid", "information limit")["divides_by"] < 1.2  # "by more than a fifth"


def test_a_figure_agrees_if_it_is_the_rounded_value() -> None:
    assert agrees(Figure("0.0082", 0.00820704))
    assert agrees(Figure("282", 281.53))
    assert agrees(Figure("1,275", 1275.2))
    assert not agrees(Figure("0.0082", 0.00826))
    assert not agrees(Figure("16", 16.588))
