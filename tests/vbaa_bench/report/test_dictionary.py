"""The data dictionary describes every column that the files have, and no other."""

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import polars as pl

from solver.instrument.beam_shape import BeamShape, stated_shape
from solver.instrument.board import Charuco, LineNetwork
from solver.instrument.observation import open_observations
from solver.instrument.rig import ClampOffset, Gravity, Sensors
from solver.instrument.rig_json import rig_to_json
from solver.instrument.units import unit_of
from solver.lab.table import COLUMNS
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import accepted_rig
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.column import Column
from vbaa_bench.dataset.dataset_columns import JOINED, READINGS, RIG, RIGS, TRUE_RIG, TRUTH
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.generation.generate_collection import rig_row
from vbaa_bench.generation.readings import readings
from vbaa_bench.report.dictionary import SECTIONS, page
from vbaa_bench.scene.frames import frame_specs
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.rigs import true_rig
from vbaa_bench.scoring.conditions import FACTOR_PREFIX
from vbaa_bench.scoring.factors import factor_table
from vbaa_bench.scoring.frame_scores import score_frames
from vbaa_bench.scoring.predictions import checked_predictions
from vbaa_bench.scoring.score import score_rigs
from vbaa_bench.scoring.score_columns import FACTORS, PREDICTIONS, SCORES, STRATA_TABLE
from vbaa_bench.scoring.strata_table import strata_rows

PAGE = Path(__file__).parents[3] / "docs" / "data_dictionary.md"


def keys(document: dict[str, object], prefix: str = "") -> set[str]:
    """Keys of nested JSON objects, with dots."""
    found = set[str]()
    for name, value in document.items():
        inner = keys(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name}
        found |= inner
    return found


def undescribed_nulls(table: pl.DataFrame, columns: dict[str, Column]) -> list[str]:
    """Columns with nulls whose description states that there are none."""
    return [
        name
        for name in table.columns
        if name in columns and not columns[name].null and table[name].null_count()
    ]


def test_the_page_is_what_the_code_generates() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: vbaa-bench schema columns > " + str(
        PAGE
    )


def test_every_entry_has_a_meaning_that_fits_on_a_line() -> None:
    for section in SECTIONS:
        for name, column in section.columns.items():
            assert 3 < len(column.meaning) < 90, name
            assert not column.meaning.endswith("."), name


def test_units_are_those_of_the_names() -> None:
    assert unit_of("flexural_rigidity_n_mm2").text == "N mm^2"
    assert unit_of("k_s_n_m").text == "N/m"
    assert unit_of("compliance_error_mm_per_n").text == "mm/N"
    assert unit_of("base_moment_n_mm").text == "N mm"
    assert unit_of("frame_id").text == unit_of("push").text == ""


def test_truth_and_true_rig_of_a_dataset_are_described(dataset: Path) -> None:
    truth = open_truth(Layout(dataset).truth)
    # Columns of a carriage exist only with one.
    absent = {"drawn.*", "touched_table_mm", *(n for n in TRUTH if n.startswith("true_carriage_"))}
    assert set(truth.frames.columns) == set(TRUTH) - absent
    assert keys(truth.manifest["true_rig"]) == set(TRUE_RIG)
    assert undescribed_nulls(truth.frames, TRUTH) == []


def test_truth_and_readings_share_only_the_columns_that_join_them(dataset: Path) -> None:
    table = next((dataset / "observations").glob("shard_*/metadata.csv"))
    with table.open(encoding="utf-8") as stream:
        read = set(next(csv.reader(stream)))
    assert read <= set(READINGS)
    assert set(open_truth(Layout(dataset).truth).frames.columns) & read == set(JOINED)
    assert set(TRUTH) & set(READINGS) == set(JOINED) == {"frame_id", "push_id", "step"}


def test_readings_of_all_sensors_are_described(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(
        f"{SMALL_SCENE}\nmoment_sensor: {{sigma_n_mm: 0.01}}\n"
        "force_sensor: {force_sigma_n: 1.0e-4, moment_sigma_n_mm: 0.01}\n"
        "occlusion: {kind: [removed], place: [middle], availability: [0.5]}\n"
        "splits: {shares: {train: 0.5, test: 0.5}}\ncarriage: {}\n",
        encoding="utf-8",
    )
    scene = load_scene(path).scene
    spec = frame_specs(scene)[0]
    state = Experiment(scene, true_rig(scene), spec.push, tmp_path).states()[0]
    values = readings(scene, spec, state, (0.1, 0.2), np.eye(4))
    assert {"file_name", "frame_id", *values} == set(READINGS)


def test_every_key_of_a_rig_is_described(dataset: Path) -> None:
    rig = open_observations(dataset / "observations").rig
    found = keys(json.loads(rig_to_json(rig)))
    full = dataclasses.replace(
        rig,
        sag=1e-3,
        sag_in_plane=np.array([0.0, 1e-3]),
        known_psi=0.1,
        bits=12,
        channel="r",
        gravity=Gravity(1.0, 0.1),
        clamp_offset=ClampOffset(np.ones(2)),
        sensors=Sensors(1e-5, 1e-4, 1e-5),
        tolerances=dataclasses.replace(rig.tolerances, camera_shift_px=0.1),
    )
    for board in (Charuco(11, 6, 0.02, "4x4_50"), LineNetwork(11, 6, 0.02, 0.001)):
        found |= keys(json.loads(rig_to_json(dataclasses.replace(full, board=board))))
    learned = BeamShape(softness=1e-3, covariance=np.eye(3), friction_coefficient=0.3)
    for shape in (
        stated_shape(0.02, 0.01, 0.02, 0.2, 0.001, rigid_objects=True, bow_sigma=1e-4),
        learned,
    ):
        found |= keys(json.loads(rig_to_json(dataclasses.replace(full, shape=shape))))
    assert found == set(RIG) - {"base.clamp_offset_sigma_mm"}  # written as a covariance


def predictions(dataset: Path) -> pl.DataFrame:
    """A table of a method, with all columns: right to 1 mm, the last frame refused."""
    ids = sorted(open_truth(Layout(dataset).truth).frames["frame_id"])
    rows = [
        dict.fromkeys(PREDICTIONS, 1.0) | {"frame_id": name, "outcome": "contact"} for name in ids
    ]
    rows[-1] |= dict.fromkeys(("x_c_mm", "force_n")) | {"outcome": "invalid"}
    return pl.DataFrame(rows, infer_schema_length=None).with_columns(
        message=pl.lit("text"), assumption=pl.when(outcome="invalid").then(pl.lit("taper"))
    )


def test_columns_of_predictions_and_scores_are_described(dataset: Path) -> None:
    assert tuple(PREDICTIONS) == (*COLUMNS, "processor_ms", "reference_ms")
    truth = open_truth(Layout(dataset).truth)
    table = checked_predictions(predictions(dataset), "")
    scores = score_frames(truth, table, "own", "")
    assert set(scores.columns) == set(SCORES) - {"rig", f"{FACTOR_PREFIX}*"}
    assert undescribed_nulls(scores, SCORES) == []
    strata = pl.DataFrame(strata_rows(scores), infer_schema_length=None)
    assert strata.columns == list(STRATA_TABLE)
    assert undescribed_nulls(strata, STRATA_TABLE) == []


def test_columns_of_a_scored_collection_are_described(dataset: Path, tmp_path: Path) -> None:
    layout = CollectionLayout(tmp_path)
    for number in range(2):
        (layout.rig(number).root / "predictions").mkdir(parents=True)
        for tree in ("observations", "truth"):
            (layout.rig(number).root / tree).symlink_to(dataset / tree)
        predictions(dataset).write_csv(layout.rig(number).root / "predictions" / "own.csv")
    score_rigs(tmp_path)
    scores = pl.read_parquet(tmp_path / "scores" / "scores.parquet")
    names = {
        f"{FACTOR_PREFIX}*" if name.startswith(FACTOR_PREFIX) else name for name in scores.columns
    }
    assert names == set(SCORES)
    # A group of a factor needs 40 frames.
    assert factor_table(pl.concat([scores] * 40)).columns == list(FACTORS)


def test_columns_of_the_table_of_rigs_are_described(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(
        f"{SMALL_SCENE}\nrigs: 2\nbeam: {{diameter_mm: {{uniform: [0.7, 0.9]}}}}\n",
        encoding="utf-8",
    )
    file = load_scene(path)
    row = rig_row(file, 0, accepted_rig(file).scene)
    assert "beam.diameter_mm" in row
    assert {"*.*" if "." in name else name for name in row} == set(RIGS)
