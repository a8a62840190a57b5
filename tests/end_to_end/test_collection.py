"""Collections of random rigs, sets that grow and parts that are merged: always the same bytes."""

from pathlib import Path

import polars as pl
import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from solver.instrument.hashes import HASHES
from tests.draws import seeded
from tests.end_to_end.test_generate import digests, quiet
from vbaa_bench import cli
from vbaa_bench.api import results
from vbaa_bench.api.data import generate_rigs
from vbaa_bench.api.verification import verify
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.merge import merge
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.generation.generate import Part, generate
from vbaa_bench.generation.generate_collection import generate_collection
from vbaa_bench.scene.load import load_scene
from vbaa_bench.workers import machine
from vbaa_bench.workers import pool as pools
from vbaa_bench.workers.jobs import SameProcess

SCENE = seeded("""\
title: Small random rigs
seed: 3
rigs: {rigs}
beam: {{length_mm: {{uniform: [150, 250]}}}}
camera:
  width_px: 192
  height_px: 80
  focal_length_px: 260
  position_mm: [{{from: beam.length_mm, times: 0.5}}, 14, {{from: beam.length_mm, times: 1.6}}]
  look_at_mm: [{{from: beam.length_mm, times: 0.5}}, 14, 0]
light: {{height_mm: {{from: beam.length_mm, times: 2}}}}
calibration:
  columns: 14
  rows: 5
  square_mm: {{from: beam.length_mm, times: 0.06}}
  center_mm: [{{from: beam.length_mm, times: 0.5}}, 14]
  views: 3
sensor: {{rest_images: 1}}
object: {{kind: peg, radius_mm: {{uniform: [1, 3], per: push}}}}
background: {{reflectance: {{uniform: [0.02, 0.3], per: frame}}}}
render: {{noise_elsewhere: 2, noise_near_beam: 1, sample_table: false}}
pushes:
  contact_distance_mm: [{{from: beam.length_mm, times: {{uniform: [0.3, 0.8]}}}}]
  deflection_pct: [{{uniform: [3, 9]}}]
  repeats: {repeats}
frames_per_shard: 2
""")


def scene(folder: Path, rigs: int, repeats: int = 3) -> Path:
    path = folder / f"rigs_{rigs}_{repeats}.yaml"
    path.write_text(SCENE.format(rigs=rigs, repeats=repeats), encoding="utf-8")
    return path


@pytest.mark.thorough
def test_rigs_do_not_depend_on_workers_order_count_or_part(
    tmp_path: Path, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = scene(tmp_path, 1), scene(tmp_path, 2)
    together, apart = tmp_path / "together", [tmp_path / f"part {n}" for n in (1, 2)]
    # Each rig has a fresh worker, as one has whose memory has grown.
    with monkeypatch.context() as patch:
        patch.setattr(pools, "GROWTH_MB", -1.0)
        generate_rigs(two, together, workers=1, variant=variant)
    # The others are generated in this process: the start of another takes longer than a rig.
    monkeypatch.setattr(machine, "Pool", SameProcess)
    for number, folder in enumerate(apart):
        generate_collection(load_scene(two), folder, variant, 0, quiet, range(2)[number::2])
    merge(apart, tmp_path / "merged")
    assert digests(tmp_path / "merged") == digests(together)
    # A smaller collection grows: its rigs are kept, byte for byte.
    grown = tmp_path / "grown"
    generate_collection(load_scene(one), grown, variant, 0, quiet)
    hashes = CollectionLayout(grown).rig(0).hashes
    written = hashes.stat().st_mtime_ns
    collection = generate_rigs(two, grown, workers=1, variant=variant)
    assert hashes.stat().st_mtime_ns == written
    assert digests(grown) == digests(together)
    assert sorted(collection.rigs) == [0, 1]

    # What is damaged in it is rendered again, byte for byte.
    layout, whole = CollectionLayout(grown), digests(grown)
    image = next(layout.rig(1).observations.glob("shard_*/*.png"))
    for path in (image, layout.table):
        path.write_bytes(path.read_bytes()[:-9])
    assert {fault.path for fault in verify(grown).faults} == {image, layout.table}
    repaired = verify(grown, repair=True, workers=1)
    assert (len(repaired.faults), len(repaired.repaired)) == (0, 2)
    assert digests(grown) == whole

    table = collection.table
    assert table["rig"].to_list() == [0, 1]
    lengths = [
        data.truth.manifest["scene"]["beam"]["length_mm"] for data in collection.rigs.values()
    ]
    assert table["beam.length_mm"].to_list() == pytest.approx(lengths)
    assert len(set(lengths)) == 2
    frames = collection.rigs[1].truth.frames
    assert frames["drawn.background.reflectance"].n_unique() == 3
    assert frames["drawn.object.radius_mm"].is_between(1, 3).all()

    # The commands treat a collection as they treat a dataset.
    runner = CliRunner()
    monkeypatch.setattr(results, "cores", lambda: 1)  # the start of a process takes longest
    for command in (
        ["solve", str(grown), "--method", "exact_fit", "--repeats", "1"],
        ["score", str(grown)],
        ["report", str(grown)],
    ):
        done = runner.invoke(cli.app, command)
        assert done.exit_code == 0, (command, done.output, done.exception)
    scores = pl.read_parquet(grown / "scores" / "scores.parquet")
    assert scores.height == 6
    assert sorted(scores["rig"].unique()) == [0, 1]
    assert "rig 1" in (grown / "report" / "report.html").read_text(encoding="utf-8")


@pytest.mark.thorough
def test_parts_of_a_dataset_are_merged_to_the_same_bytes(tmp_path: Path, variant: str) -> None:
    text = scene(tmp_path, 1, 5).read_text(encoding="utf-8").replace("rigs: 1\n", "")
    (tmp_path / "one.yaml").write_text(text, encoding="utf-8")
    file = load_scene(tmp_path / "one.yaml").rig(0)
    whole, parts = tmp_path / "whole", [tmp_path / f"part {n}" for n in (1, 2)]
    generate(file, whole, variant, 0, quiet)
    for number, folder in enumerate(parts, start=1):
        generate(file, folder, variant, 0, quiet, part=Part(number, 2))
    assert open_truth(parts[0] / "truth").frames.height == 3
    assert open_truth(parts[1] / "truth").frames.height == 2
    merge(parts, tmp_path / "merged")
    assert digests(tmp_path / "merged") == digests(whole)

    with pytest.raises(InputError, match="is not empty"):
        merge(parts, tmp_path / "merged")
    other = load_scene(tmp_path / "one.yaml", seed=4).rig(0)
    generate(other, tmp_path / "other", variant, 0, quiet, part=Part(2, 2))
    with pytest.raises(InputError, match="is no part of the dataset"):
        merge([parts[0], tmp_path / "other"], tmp_path / "both")
    (parts[1] / "truth" / HASHES).unlink()
    with pytest.raises(InputError, match=r"incomplete|cannot be written"):
        merge(parts, tmp_path / "damaged")
