"""The judge: truth scores zero, failures count, nothing of the truth reaches a method."""

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import InputError
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.isolation.runs import solve
from vbaa_bench.scoring.predictions import read_predictions
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import found_predictions, score, with_own


@pytest.fixture
def results(dataset: Path, tmp_path: Path) -> Results:
    shutil.copytree(dataset, tmp_path / "small")
    return Results(tmp_path / "small")


def truth_table(results: Results) -> pl.DataFrame:
    frames = open_truth(results.dataset.truth).frames
    return frames.select("frame_id", "x_c_mm", "s_c_mm", "force_n")


@pytest.fixture(scope="module")
def exact_fit_table(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Estimates of `exact_fit` from its own process, beside the true truth. Not to be written."""
    path = tmp_path_factory.mktemp("solved") / "exact_fit.csv"
    solve(Layout(dataset), "exact_fit", path, 1)
    return path


def test_every_frame_has_a_reference_time(exact_fit_table: Path) -> None:
    times = pl.read_csv(exact_fit_table)["processor_ms", "reference_ms"]
    assert times.height == 4
    assert (times.to_numpy() > 0).all()


def test_a_file_of_ones_own_is_scored_beside_the_methods(
    results: Results, exact_fit_table: Path
) -> None:
    own = results.root / "own.csv"
    truth_table(results).with_columns(outcome=pl.lit("contact"), image_ms=1.5).write_csv(own)
    methods = score(results, {"exact_fit": exact_fit_table, "own": own})["methods"]
    assert methods["own"]["x_c_rmse_pct_L"] == 0
    assert methods["own"]["ms_per_frame_median"] == 1.5
    assert 0 < methods["exact_fit"]["x_c_rmse_pct_L"] < 0.3


def test_a_method_cannot_choose_its_frames(results: Results) -> None:
    table = truth_table(results)
    first = pl.col("frame_id") == table["frame_id"][0]
    path = results.root / "picky.csv"
    table.with_columns(x_c_mm=pl.when(first).then("x_c_mm")).write_csv(path)
    found = score(results, {"picky": path})["methods"]["picky"]
    assert (found["n"], found["failure_rate"]) == (4, 0.75)
    table.drop("x_c_mm").write_csv(path)  # a method for forces alone owes no distance
    assert score(results, {"picky": path})["methods"]["picky"]["failure_rate"] == 0


def test_a_file_of_ones_own_is_kept_and_may_be_replaced(results: Results, tmp_path: Path) -> None:
    table, path = truth_table(results), tmp_path / "own.CSV"
    table.with_columns(pl.col("x_c_mm") + 2.4).write_csv(path)
    score(results, with_own(results, [path]))
    path.unlink()
    assert set(score(results, found_predictions(results))["methods"]) == {"own"}
    other = tmp_path / "own.PARQUET"
    table.write_parquet(other)
    score(results, with_own(results, [other]))
    assert [kept.name for kept in results.predictions.glob("own.*")] == ["own.parquet"]
    found = score(results, found_predictions(results))["methods"]
    assert found["own"]["x_c_rmse_pct_L"] == 0
    other.write_bytes(b"no table")  # what is not accepted replaces nothing
    with pytest.raises(InputError, match="not a Parquet table"):
        score(results, with_own(results, [other]))
    assert read_predictions(results.predictions / "own.parquet").height == 4


def test_a_file_of_ones_own_takes_no_name_of_a_method(results: Results, tmp_path: Path) -> None:
    for name in ("exact_fit.csv", "two_point@area_weighted.csv", "my_method.halfway.csv"):
        with pytest.raises(InputError, match="is the name of a method of solve"):
            with_own(results, [tmp_path / name])
    with pytest.raises(InputError, match="two files are called own"):
        with_own(results, [tmp_path / "own.csv", tmp_path / "more" / "own.csv"])


def test_other_columns_and_units_are_warned_of(results: Results, tmp_path: Path) -> None:
    table, path = truth_table(results), tmp_path / "own.csv"

    def warnings(written: pl.DataFrame) -> list[str]:
        written.write_csv(path)
        said: list[str] = score(results, {"own": path})["warnings"]
        return [sentence.removeprefix(f"{path}: ") for sentence in said]

    # An entrant whose distances are off by a factor of two is a poor one, no mistaken one.
    assert warnings(table.with_columns(pl.col("x_c_mm", "s_c_mm") * 2, chi2=1.0)) == []
    metres = warnings(table.with_columns(pl.col("x_c_mm") / 1e3))
    assert [said.partition(",")[0] for said in metres] == ["the median of x_c_mm is 0.196"]
    assert metres[0].endswith("it seems to be in m instead of mm")
    millinewtons = warnings(table.with_columns(pl.col("force_n") * 1e3))[0]
    assert millinewtons.endswith("it seems to be in mN instead of N")
    assert warnings(table.with_columns(pl.col("force_n") * 1e6))[0].endswith("is it in N?")
    renamed = table.with_columns(x_c_m=pl.col("x_c_mm") / 1e3, remark=pl.lit("good"))
    assert warnings(renamed.drop("x_c_mm")) == [
        "the column x_c_m is unknown and not scored; did you mean x_c_mm?",
        "the column remark is unknown and not scored",
    ]
    many = table.with_columns(pl.lit(0).alias(f"{i}") for i in range(1000))
    assert warnings(many)[-1] == "990 further columns are unknown and not scored"


def test_what_excel_writes_is_read(results: Results, tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    text = truth_table(results).write_csv(separator=";")
    path.write_text(text, encoding="utf-8-sig")
    assert score(results, {"own": path})["methods"]["own"]["x_c_rmse_pct_L"] == 0


def test_a_pipe_is_no_predictions_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "own.csv")
    with pytest.raises(InputError, match="there is no such file"):
        read_predictions(tmp_path / "own.csv")


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_the_truth_scores_zero(results: Results, suffix: str) -> None:
    path = results.root / f"oracle{suffix}"
    table = truth_table(results).sample(fraction=1, shuffle=True, seed=1)  # joined by id, not order
    if suffix == ".csv":
        table.write_csv(path)
    else:
        table.write_parquet(path)
    found = score(results, {"oracle": path})["methods"]["oracle"]
    assert found["n"] == 4
    assert found["failure_rate"] == 0
    for name in ("x_c_rmse_pct_L", "x_c_median_abs_pct_L", "x_c_p95_abs_pct_L", "s_c_rmse_pct_L"):
        assert found[name] == 0
    assert found["force_rmse_pct"] == 0
    assert found["ms_per_frame_median"] is None


def test_errors_are_what_they_say(results: Results) -> None:
    off = truth_table(results).with_columns(pl.col("x_c_mm") + 2.4, pl.col("force_n") * 0.9)
    path = results.root / "off.csv"
    off.write_csv(path)
    found = score(results, {"off": path})["methods"]["off"]
    assert found["x_c_rmse_pct_L"] == pytest.approx(1.0)
    assert found["x_c_median_abs_pct_L"] == pytest.approx(1.0)
    assert found["force_rmse_pct"] == pytest.approx(10.0)


def test_missing_and_unusable_answers_are_failures(results: Results) -> None:
    table = truth_table(results).with_columns(outcome=pl.lit("contact"))
    ids = table["frame_id"]
    holey = table.filter(pl.col("frame_id") != ids[0]).with_columns(
        x_c_mm=pl.when(pl.col("frame_id") == ids[1]).then(float("nan")).otherwise("x_c_mm"),
        force_n=pl.when(pl.col("frame_id") == ids[1]).then(float("inf")).otherwise("force_n"),
        outcome=pl.when(pl.col("frame_id") == ids[2])
        .then(pl.lit("no contact"))
        .otherwise("outcome"),
    )
    path = results.root / "holey.csv"
    holey.write_csv(path)
    found = score(results, {"holey": path})["methods"]["holey"]
    assert (found["n"], found["failure_rate"], found["x_c_rmse_pct_L"]) == (4, 0.75, 0.0)
    scores = pl.read_parquet(results.scores / "scores.parquet")
    assert scores.height == 4
    missing = scores.row(by_predicate=pl.col("frame_id") == ids[0], named=True)
    assert missing["outcome"] == "crashed"
    assert missing["message"] == "no prediction for this frame"


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (pl.DataFrame({"x_c_mm": [1.0]}), "frame_id is missing"),
        (pl.DataFrame({"frame_id": ["a"], "y": [1.0]}), "x_c_mm and force_n are both missing"),
        (pl.DataFrame({"frame_id": ["a"], "x_c_mm": ["near"]}), "not hold numbers"),
        (pl.DataFrame({"frame_id": ["a", "a"], "x_c_mm": [1.0, 1.0]}), "more than once"),
        (pl.DataFrame({"frame_id": ["a"], "x_c_mm": [1.0]}), "not of this dataset"),
        (
            pl.DataFrame({"frame_id": "OWN", "x_c_mm": [1.0], "outcome": ["won"]}),
            "'won' is unknown",
        ),
    ],
)
def test_unusable_predictions_are_refused(results: Results, table: pl.DataFrame, said: str) -> None:
    own = truth_table(results)["frame_id"][0]
    path = results.root / "bad.csv"
    table.with_columns(pl.col(pl.String).replace("OWN", own)).write_csv(path)
    with pytest.raises(InputError, match=r"bad\.csv") as caught:
        score(results, {"bad": path})
    assert said in str(caught.value)
    assert not results.scores.exists()
    with pytest.raises(InputError, match="not a CSV"):
        read_predictions(results.root / "none.csv")
    yes = results.root / "yes.parquet"
    pl.DataFrame({"frame_id": [own], "x_c_mm": [True]}).write_parquet(yes)
    with pytest.raises(InputError, match="x_c_mm holds Boolean"):
        read_predictions(yes)


USER_METHODS = """
import os, pathlib, sys
from solver.methods import METHODS

good = METHODS["exact_fit"]

def truth_in_reach():
    here = pathlib.Path(sys.argv[1]) / "observations_0"
    names = sorted(p.name for p in here.parent.rglob("*") if "truth" in p.name or "scene" in p.name)
    places = [here.parent, *map(pathlib.Path, sys.path)]
    places += [pathlib.Path(p) for v in os.environ.values() for p in v.split(os.pathsep)]
    for place in places:
        if place.is_absolute() and len(place.parts) > 2:
            names += [str(p) for p in place.glob("*/truth")] + [str(p) for p in place.glob("truth")]
    return names

def fails_in_turn(measurement, count=[0]):
    count[0] += 1
    if count[0] % 4 == 1:
        raise LookupError(f"found {truth_in_reach()}")
    if count[0] % 4 == 2:
        return None
    if count[0] % 4 == 3:
        raise SystemExit(2)
    return good(measurement)

def dies(measurement):
    os.write(2, b"\\xff\\xfe")
    os._exit(9)
"""


@pytest.fixture
def user_methods(results: Results, monkeypatch: pytest.MonkeyPatch) -> str:
    """A user's own module in the current folder, beside the dataset with its truth."""
    (results.root.parent / "user_methods.py").write_text(USER_METHODS, encoding="utf-8")
    monkeypatch.chdir(results.root.parent)
    return "user_methods"


def messages_of_failures(results: Results, method: str, failures: int) -> list[str]:
    """Run a method that fails on some of the four frames, score it, and return its messages."""
    out = results.predictions / "mine.csv"
    solve(results.dataset, method, out, 1)
    scored = score(results, {"mine": out})["methods"]["mine"]
    assert scored["n"] == 4
    assert scored["failure_rate"] == failures / 4
    failed = pl.read_csv(results.scores / "scores.csv").filter("failed")
    assert failed["outcome"].unique().to_list() == ["crashed"]
    return failed["message"].to_list()


@pytest.mark.thorough
def test_a_method_that_fails_is_rows_with_an_outcome_and_finds_no_truth(
    results: Results, user_methods: str
) -> None:
    messages = messages_of_failures(results, f"{user_methods}:fails_in_turn", 3)
    # Calls before the first frame warm up, so the order is not known.
    for sentence in ("LookupError: found []", "returned NoneType", "SystemExit: 2"):
        assert [sentence in message for message in messages].count(True) == 1, messages


@pytest.mark.thorough
def test_a_method_whose_process_dies_is_rows_with_an_outcome(
    results: Results, user_methods: str
) -> None:
    messages = messages_of_failures(results, f"{user_methods}:dies", 4)
    assert all("process died: exit status 9" in message for message in messages)


def overwrite_truth(root: Path) -> None:
    for path in root.rglob("*"):
        if path.suffix == ".parquet":
            table = pl.read_parquet(path)
            table.with_columns(pl.col("x_c_mm") * 2, pl.col("force_n") * 3).write_parquet(path)
        elif path.is_file():
            path.write_bytes(b"canary")


@pytest.mark.parametrize(
    ("method", "change"),
    [
        ("exact_fit", overwrite_truth),
        ("user_methods:good", shutil.rmtree),
    ],
)
@pytest.mark.usefixtures("user_methods")
def test_canary_a_changed_truth_changes_no_estimate(
    results: Results, exact_fit_table: Path, method: str, change: Callable[[Path], None]
) -> None:
    change(results.dataset.truth)
    path = results.root / "after.csv"
    solve(results.dataset, method, path, 1)
    # The time is no estimate; `good` is exact_fit in a module of the user.
    before, after = (
        pl.read_csv(table).drop("image_ms", "processor_ms", "reference_ms")
        for table in (exact_fit_table, path)
    )
    assert after.equals(before)


def test_the_observations_hold_nothing_of_the_truth(results: Results) -> None:
    patterns = (
        r"rig\.json|(shard_\d{5}/)?hashes\.json|calibration/view_\d\d\.png|rest/rest_\d\d\.png"
        r"|shard_\d{5}/metadata\.csv|shard_\d{5}/[0-9a-f]{16}\.png"
    )
    for path in results.dataset.observations.rglob("*"):
        name = path.relative_to(results.dataset.observations).as_posix()
        assert path.is_dir() or re.fullmatch(patterns, name), name
    for path in results.dataset.observations.rglob("*.png"):
        chunks = path.read_bytes()
        assert all(kind not in chunks for kind in (b"tEXt", b"iTXt", b"zTXt", b"tIME", b"eXIf"))
    rig = json.loads((results.dataset.observations / "rig.json").read_text())
    assert set(rig) == {"beam", "base", "board", "encoder", "camera", "light", "beam_shape"}
    for path in results.dataset.observations.rglob("metadata.csv"):
        assert path.read_text().splitlines()[0] == (
            "file_name,frame_id,motor_angle_deg,push_id,step"
        )


@pytest.mark.usefixtures("no_process")
def test_a_changed_file_is_noticed(results: Results) -> None:
    path = results.root / "oracle.csv"
    truth_table(results).write_csv(path)
    image = next(results.dataset.observations.glob("shard_*/*.png"))
    table = next(results.dataset.truth.glob("shard_*/*.parquet"))
    for victim in (image, table):
        data = bytearray(victim.read_bytes())
        data[len(data) // 2] ^= 1
        victim.write_bytes(bytes(data))
    with pytest.raises(InputError, match=image.name):
        solve(results.dataset, "two_point", results.root / "answers.csv", 1)
    with pytest.raises(InputError, match=table.name):
        score(results, {"oracle": path})
