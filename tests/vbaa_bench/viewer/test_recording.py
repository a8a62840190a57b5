"""The recording for rerun, read back: entities, times, and values."""

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from solver.instrument.errors import InputError
from vbaa_bench.report.gallery import display
from vbaa_bench.viewer.frames import ViewedDataset
from vbaa_bench.viewer.recording import write_recording


def test_a_recording_without_rerun_is_refused(
    viewed: ViewedDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"extra 'vbaa-bench\[view\]' \(rerun-sdk\); --format"):
        write_recording(viewed, tmp_path / "v.rrd")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def entities(viewed: ViewedDataset, tmp_path: Path) -> dict[str, list[Any]]:
    """Record batches of a recording, by entity."""
    chunk = pytest.importorskip("rerun.chunk")
    done: list[int] = []
    assert write_recording(viewed, tmp_path / "v.rrd", done.append) == ""
    assert done == [1, 2, 3, 4]
    assert [path.name for path in tmp_path.iterdir()] == ["v.rrd"]
    reader = chunk.RrdReader(tmp_path / "v.rrd")
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    batches: dict[str, list[Any]] = {}
    for part in reader.stream():
        batches.setdefault(part.entity_path, []).append(part.to_record_batch())
    return batches


def values(batches: list[Any], column: str) -> list[Any]:
    """Values of a column, in the order of the frames if they change over time."""
    rows = [
        (batch.column("frame")[i].as_py() if "frame" in batch.schema.names else -1, value.as_py())
        for batch in batches
        for name in batch.schema.names
        if name.endswith(column)
        for i, value in enumerate(batch.column(name))
    ]
    return [value for _, value in sorted(rows, key=lambda row: row[0])]


def test_values_over_time_are_those_of_the_tables(
    entities: dict[str, list[Any]], viewed: ViewedDataset
) -> None:
    frames = list(viewed)
    true = values(entities["/x_c/true"], "scalars")
    assert [value[0] for value in true if value] == [frame.row["x_c_mm"] for frame in frames]
    errors = values(entities["/x_c_error/mine"], "scalars")
    assert [value[0] for value in errors if value][:3] == pytest.approx([-1.95] * 3)
    assert np.isnan(errors[-1][0])
    forces = values(entities["/force/exact_fit"], "scalars")
    expected = [1.01e3 * frame.row["force_n"] for frame in frames]
    assert [value[0] for value in forces if value] == pytest.approx(expected)
    moving = [batch for batch in entities["/x_c/true"] if "frame" in batch.schema.names]
    times = [
        tuple(batch.column(name)[i].as_py() for name in ("frame", "push"))
        for batch in moving
        for i in range(batch.num_rows)
    ]
    assert sorted(times) == [(0, 0), (1, 0), (2, 1), (3, 1)]
    assert not any(name.startswith("/psi/") and name != "/psi/true" for name in entities)


def test_space_and_image_agree(entities: dict[str, list[Any]], viewed: ViewedDataset) -> None:
    """Project what is in space by the recording's own camera, as rerun does."""
    camera = entities["/space/camera"]
    matrix = np.array(values(camera, "image_from_camera")[0]).reshape(3, 3).T
    rotation = np.array(values(camera, "mat3x3")[0]).reshape(3, 3).T
    position = np.array(values(camera, "translation")[0])[0]
    for i, frame in enumerate(viewed):
        beam = np.array(values(entities["/space/3d/beam"], "strips")[i])[0]
        in_camera = (beam - position) @ rotation
        assert in_camera[:, 2].min() > 0
        pixels = in_camera @ matrix.T
        drawn = np.array(values(entities["/space/camera/beam"], "strips")[i])[0]
        assert pixels[:, :2] / pixels[:, 2:] == pytest.approx(drawn, abs=2e-3)
        assert drawn == pytest.approx(frame.overlay.centreline + 0.5, abs=1e-3)
        contact = np.array(values(entities["/space/3d/contact"], "positions")[i])
        assert contact == pytest.approx(np.array([frame.row["contact_antenna_mm"]]), abs=1e-3)


def test_images_and_ellipses(entities: dict[str, list[Any]], viewed: ViewedDataset) -> None:
    blobs = values(entities["/space/camera/image"], "blob")
    for frame, blob in zip(viewed, blobs, strict=True):
        content = np.array(blob[0], np.uint8)
        image = cv2.imdecode(content, cv2.IMREAD_UNCHANGED)
        assert image is not None
        assert np.array_equal(image, display(frame.image))
    outlines = values(entities["/errors/exact_fit/ellipse"], "strips")
    assert [np.array(outline).shape for outline in outlines] == [(1, 97, 2)] * 4
    assert not any(values(entities["/errors/mine/ellipse"], "strips"))
    in_plane = np.array(values(entities["/space/3d/estimates/exact_fit/ellipse"], "strips")[0])[0]
    # Two sigmas and a half of 0.04 mm, in the plane of bending.
    assert np.ptp(in_plane[:, 0]) == pytest.approx(2 * 2.448 * 0.04, rel=0.01)
    assert np.ptp(in_plane[:, 2]) == 0
    assert len(values(entities["/table"], "text")) == 4


def test_bodies_that_do_not_move_are_written_once(entities: dict[str, list[Any]]) -> None:
    assert len(values(entities["/space/3d/bodies/hub"], "vertex_positions")) == 1
    assert len(values(entities["/space/3d/bodies/object"], "vertex_positions")) == 4
