"""Nothing but the shape of the beam predicts the contact distance; planted leaks are found."""

import json
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from solver.instrument.errors import InputError
from solver.instrument.files import sha256
from solver.instrument.images import png_bytes
from solver.instrument.units import DEGREE
from tests.conftest import SMALL_SCENE
from tests.draws import generator
from tests.truth_rows import complete_row
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import plan
from vbaa_bench.benchmarks.leaks import (
    ImageFacts,
    LeakFrame,
    LeakTest,
    find_leaks,
    leak_tests,
    png_chunks,
)
from vbaa_bench.cli.main import app
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.manifest import seal
from vbaa_bench.dataset.writer import shard_writer
from vbaa_bench.generation.readings import readings
from vbaa_bench.scene.load import load_scene

RANDOM_PUSHES = """  contact_distance_mm: [{uniform: [36, 220]}]
  deflection_pct: [{log_uniform: [1, 25]}]
  repeats: 240
"""
ENCODER = "encoder, pushes of one frame"
ORDER = "order of the files"


def unrendered(tmp_path: Path, pushes: str = RANDOM_PUSHES, per_shard: int = 16) -> list[LeakFrame]:
    """Frames of a random scene in the order of their files, with encoder but without images."""
    before, _, after = SMALL_SCENE.partition("pushes:\n")
    text = f"{before}pushes:\n{pushes}{after.partition('frames_per_shard: 2')[2]}"
    path = tmp_path / "scene.yaml"
    path.write_text(f"{text}\nframes_per_shard: {per_shard}\n", encoding="utf-8")
    file = load_scene(path)
    made = plan(file)
    frames = []
    for first in range(0, made.frames, per_shard):
        shard = made.frame_specs[first : first + per_shard]
        for position, spec in enumerate(sorted(shard, key=lambda spec: spec.frame_id)):
            experiment = Experiment(spec.scene, made.rig, spec.push, tmp_path)
            state = experiment.states()[spec.step]
            angle = float(readings(spec.scene, spec, state, None)["motor_angle_deg"]) * DEGREE
            x_c = state.contact.point[0] / made.rig.beam.length
            names = spec.frame_id, spec.push_id
            frames.append(LeakFrame(x_c, 0, first // per_shard, position, *names, angle))
    return frames


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> list[LeakFrame]:
    return unrendered(tmp_path_factory.mktemp("random"))


@pytest.fixture(scope="module")
def unread(clean: list[LeakFrame]) -> list[LeakFrame]:
    """The same frames without an encoder."""
    return [replace(frame, motor_angle=None) for frame in clean]


def leaking(frames: list[LeakFrame]) -> set[str]:
    return clear_leaks(leak_tests(frames))


def clear_leaks(tests: list[LeakTest]) -> set[str]:
    """Features that leak beyond doubt: one in a hundred clean ones exceeds `chance`.

    Planted leaks have an R^2 of 0.5 and more; that of clean features scatters by 0.04.
    """
    return {test.feature for test in tests if test.r_squared > max(test.chance, 0.0) + 0.2}


@pytest.mark.thorough
def test_order_and_names_of_a_random_scene_do_not_leak(clean: list[LeakFrame]) -> None:
    tests = leak_tests(clean)
    assert [test.feature for test in tests] == [ORDER, "frame_id", "push_id", ENCODER]
    assert all(test.frames == 240 for test in tests)
    assert leaking(clean) == set()
    assert all(0 < test.chance < 0.1 for test in tests)


@pytest.mark.thorough
def test_the_encoder_of_single_frames_does_not_leak_even_at_equal_deflections(
    tmp_path: Path,
) -> None:
    """At a given deflection the pushing angle depends on the contact, but the motor angle does not.

    With 20 % in all pushes the pushing angle has a standard deviation of 0.9 degrees.
    """
    pushes = """  contact_distance_mm: [{uniform: [40, 215]}]
  deflection_pct: [20]
  repeats: 240
"""
    frames = unrendered(tmp_path, pushes)
    assert leaking(frames) == set()
    x_c = np.array([frame.x_c_over_length for frame in frames])
    drawn = np.array([frame.motor_angle for frame in frames])
    pushing = np.arcsin(2 * 0.2 / (3 - x_c))
    assert np.ptp(pushing) > 2.5 * DEGREE
    # An onset from a tenth of the range, so that the leak is clear.
    onsets = [
        replace(f, motor_angle=float(m / 10 - p))
        for f, m, p in zip(frames, drawn, pushing, strict=True)
    ]
    assert leaking(onsets) == {ENCODER}
    # The range is that of the scene.
    assert 9 * DEGREE < np.abs(drawn).max() < 10.3 * DEGREE


def test_frames_sorted_by_contact_distance_leak_by_their_order(unread: list[LeakFrame]) -> None:
    ordered = sorted(unread, key=lambda frame: frame.x_c_over_length)
    planted = [
        replace(frame, shard=number // 16, position=number % 16)
        for number, frame in enumerate(ordered)
    ]
    assert leaking(planted) - {ENCODER} == {ORDER}


def test_files_in_the_order_of_sobol_points_leak_by_the_bits_of_their_number(
    random: np.random.Generator,
) -> None:
    # Sobol's first digit follows from the lowest bit of the number: neighbours are far apart, and
    # a regression on the number itself finds nothing.
    numbers = np.arange(256)
    bits = numbers[:, None] >> np.arange(8) & 1
    van_der_corput = bits @ 0.5 ** np.arange(1, 9)
    frames = [
        LeakFrame(float(label), 0, number, 0, random.bytes(8).hex(), random.bytes(8).hex())
        for number, label in enumerate(van_der_corput)
    ]
    assert leaking(frames) == {ORDER}


@pytest.mark.parametrize("name", ["frame_id", "push_id"])
def test_a_name_that_counts_the_contact_distances_leaks(unread: list[LeakFrame], name: str) -> None:
    names = [f"{round(1000 * frame.x_c_over_length):016x}" for frame in unread]
    planted = [
        replace(frame, frame_id=one) if name == "frame_id" else replace(frame, push_id=one)
        for frame, one in zip(unread, names, strict=True)
    ]
    assert leaking(planted) == {name}


def image(**changes: object) -> ImageFacts:
    facts = ImageFacts(512, 176, 8, (("IHDR", 0), ("IDAT", 0), ("IEND", 0)), (40.0, 90.0))
    return replace(facts, **changes)  # type: ignore[arg-type]


def test_each_property_of_the_image_files_is_tested(unread: list[LeakFrame]) -> None:
    def with_images(facts: list[ImageFacts]) -> list[LeakFrame]:
        return [replace(f, image=one) for f, one in zip(unread, facts, strict=True)]

    labels = [frame.x_c_over_length for frame in unread]
    text = (("IHDR", 0), ("tEXt", 9), ("IDAT", 0), ("IEND", 0))
    plain = image().chunks
    assert leaking(with_images([image()] * len(labels))) == set()
    assert leaking(with_images([image(width=400 + int(99 * x)) for x in labels])) == {"image size"}
    assert leaking(with_images([image(exposure=(40 + x, 90.0)) for x in labels])) == {"exposure"}
    chunked = [image(chunks=text if x > 0.5 else plain) for x in labels]
    assert leaking(with_images(chunked)) == {"PNG metadata"}
    # The same chunks in another order.
    moved = (text[0], text[2], text[1], text[3])
    chunked = [image(chunks=text if x > 0.5 else moved) for x in labels]
    assert leaking(with_images(chunked)) == {"PNG metadata"}


def test_rigs_of_a_collection_are_held_out_whole(random: np.random.Generator) -> None:
    """The exposure identifies a rig, but reveals nothing of a rig that was never seen."""

    def rigs(slope: float) -> list[LeakFrame]:
        frames = []
        for rig in range(60):
            middle = random.uniform(0.3, 0.8)  # rigs differ in where they are touched
            exposure = slope * middle + random.uniform(0, 1), 90.0
            frames += [
                LeakFrame(
                    middle + random.uniform(-0.05, 0.05),
                    rig,
                    0,
                    position,
                    random.bytes(8).hex(),
                    random.bytes(8).hex(),
                    random.uniform(-10, 10),
                    image(exposure=exposure),
                )
                for position in range(5)
            ]
        return frames

    assert leaking(rigs(0)) == set()
    assert leaking(rigs(4)) == {"exposure"}


def test_frames_of_one_push_are_held_out_together(random: np.random.Generator) -> None:
    """A push_id is common to frames that share a contact distance: this is no leak."""
    frames = []
    for _ in range(40):
        x_c, push_id = random.uniform(0.2, 0.9), random.bytes(8).hex()
        frames += [
            LeakFrame(x_c, 0, 0, 0, random.bytes(8).hex(), push_id, random.uniform(-1, 1))
            for _step in range(6)
        ]
    assert leaking(frames) == set()
    # Steps of a push have related motor angles; their encoder is not tested.
    assert ENCODER not in {test.feature for test in leak_tests(frames)}


@pytest.mark.false_alarm(2e-6, "binomial, more than 7 of 80 at 1 %")
def test_a_clean_feature_fails_once_in_a_hundred() -> None:
    """The test has the size that it states, whatever the shape of the feature."""
    failed = Counter[bool]()
    for seed in range(40):
        random = generator(__name__, seed)
        frames = [
            LeakFrame(random.beta(2, 5), 0, 0, 0, random.bytes(8).hex(), random.bytes(8).hex())
            for _ in range(40)
        ]
        failed.update(test.passes for test in leak_tests(frames, seed))
    assert failed.total() == 120  # a third of them have one order, which is constant
    assert failed[False] <= 7


def test_generated_images_have_no_chunks_but_their_picture(dataset: Path) -> None:
    paths = sorted((dataset / "observations").rglob("*.png"))
    assert len(paths) == 4 + 6 + 2
    for path in paths:
        assert png_chunks(path.read_bytes()) == (("IHDR", 0), ("IDAT", 0), ("IEND", 0))


def test_chunks_of_a_png_are_listed_in_their_order(random: np.random.Generator) -> None:
    data = png_bytes(random.integers(0, 255, (300, 300), dtype=np.uint8))
    text = b"\x00\x00\x00\x05tEXtab\x00cd\x00\x00\x00\x00"
    assert png_chunks(data[:33] + text + data[33:])[:3] == (("IHDR", 0), ("tEXt", 5), ("IDAT", 0))
    with pytest.raises(ValueError, match="ends within a chunk"):
        png_chunks(data[:-3])


@pytest.mark.thorough
@pytest.mark.parametrize("planted", [False, True], ids=["clean", "ordered"])
def test_a_dataset_and_a_collection_are_read_and_tested(
    dataset: Path, tmp_path: Path, planted: bool
) -> None:
    root = tmp_path / "collection"
    for rig in range(20):
        written(CollectionLayout(root).rig(rig), dataset, rig, planted)
    with pytest.raises(InputError, match="has 12 pushes with contact"):
        find_leaks(CollectionLayout(root).rig(3).root)
    (root / "collection.json").write_text("{}", encoding="utf-8")
    together = {test.feature: test for test in find_leaks(root)}
    assert {test.frames for test in together.values()} == {20 * 12}
    names = (ORDER, "frame_id", "push_id", "image size", "exposure", "PNG metadata", ENCODER)
    assert tuple(together) == names
    leaks = {ORDER, "frame_id", ENCODER} if planted else set[str]()
    assert clear_leaks(list(together.values())) == leaks
    # These datasets lack files, which the command names and counts beside the leaks.
    done = CliRunner().invoke(app, ["verify", str(root), "--leaks", "--json"])
    record = json.loads(done.stdout)
    assert done.exit_code == 1
    assert record["faults"]
    verdicts = {row["feature"]: row["passes"] for row in record["features"]}
    assert verdicts == {name: test.passes for name, test in together.items()}


@pytest.mark.parametrize(("r_squared", "status"), [(0.0, 0), (0.5, 1)])
def test_a_leak_of_an_intact_dataset_decides_the_exit_status(
    dataset: Path, monkeypatch: pytest.MonkeyPatch, r_squared: float, status: int
) -> None:
    found = [LeakTest("frame_id", 40, r_squared, 0.1)]
    monkeypatch.setattr("vbaa_bench.benchmarks.leaks.find_leaks", lambda _root: found)
    done = CliRunner().invoke(app, ["verify", str(dataset), "--leaks"])
    assert done.exit_code == status, done.output
    assert ("yes" if status == 0 else "no") in done.stdout.split()
    assert CliRunner().invoke(app, ["verify", str(dataset)]).exit_code == 0


def written(layout: Layout, dataset: Path, rig: int, planted: bool) -> None:
    """Write a dataset of 12 pushes without a renderer; frames without contact are left out."""
    random = generator(__name__, rig)
    layout.observations.mkdir(parents=True)
    layout.truth.mkdir()
    whole: dict[str, dict[str, str]] = {"observations": {}, "truth": {}}
    for name in ("rig.json", "calibration/view_00.png", "rest/rest_00.png"):
        target = layout.observations / name
        target.parent.mkdir(exist_ok=True)
        shutil.copy(dataset / "observations" / name, target)
        whole["observations"][name] = sha256(target)
    labels = random.uniform(40, 200, 12)
    names = sorted(random.bytes(8).hex() for _ in labels)
    readings = random.uniform(-10, 10, 12)
    if planted:
        labels.sort()
        readings = -labels / 20
    for number in range(3):
        with shard_writer(layout, number) as writer:
            for i in range(4 * number, 4 * number + 4):
                row = {"motor_angle_deg": readings[i], "push_id": random.bytes(8).hex(), "step": 0}
                pixels = np.zeros((4, 5), dtype=np.uint8)
                writer.add(names[i], pixels, row, complete_row(x_c_mm=labels[i]), {})
            writer.add("f" * 15 + str(number), pixels, row, complete_row(), {})
        for tree, digest in writer.digests.items():
            whole[tree][f"shard_{number:05d}/hashes.json"] = digest
    facts = json.loads((dataset / "truth" / "manifest.json").read_text(encoding="utf-8"))
    seal(layout, {key: value for key, value in facts.items() if key != "versions"}, whole)


def test_a_dataset_too_small_for_the_test_is_rejected(dataset: Path) -> None:
    with pytest.raises(InputError, match="has 2 pushes with contact, allowed is >= 20"):
        find_leaks(dataset)


def test_a_constant_feature_passes() -> None:
    assert LeakTest("image size", 300, 0.0, 0.0).passes
    assert not LeakTest("image size", 300, 0.1, 0.05).passes
