"""Frames to be viewed: their order, their selection, and what belongs to them."""

from pathlib import Path

import numpy as np
import pytest
from trimesh.triangles import closest_point

from solver.instrument.errors import InputError
from tests.vbaa_bench.stored import store
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.viewer.bodies import Bodies
from vbaa_bench.viewer.frames import ViewedDataset, open_frames


def test_frames_come_push_by_push(predicted: Path, viewed: ViewedDataset) -> None:
    truth = open_truth(predicted / "truth").frames.sort("trial")
    frames = list(viewed)
    assert [frame.row["frame_id"] for frame in frames] == truth["frame_id"].to_list()
    assert [(frame.number, frame.push, frame.row["step"]) for frame in frames] == [
        (0, 0, 0),
        (1, 0, 1),
        (2, 1, 0),
        (3, 1, 1),
    ]
    assert frames[2].row["centreline_x_mm"] == truth["centreline_x_mm"][2].to_list()
    assert frames[2].title.startswith(f"push 1, step 0: x_c = {truth['x_c_mm'][2]:.4g} mm")
    assert frames[0].image.shape == (176, 512)
    assert set(frames[0].estimates) == set(frames[0].overlay.estimates) == {"exact_fit", "mine"}
    assert set(frames[3].estimates) == {"exact_fit"}


def test_frames_are_selected(predicted: Path) -> None:
    part = open_frames(predicted, slice(1, 3))
    assert [(frame.number, frame.push) for frame in part] == [(1, 0), (2, 1)]
    assert all(table.height == 2 for table in part.predictions.values())
    push = list(part)[1].row["push_id"]
    assert [frame.number for frame in open_frames(predicted, slice(0, 9), [push])] == [2, 3]
    with pytest.raises(InputError, match=r"no frame is selected, allowed is a range within 0:4"):
        open_frames(predicted, slice(4, 9))
    with pytest.raises(InputError, match="the push 'x' does not exist"):
        open_frames(predicted, slice(None), ["x"])


def test_one_rig_of_a_collection_is_viewed(tmp_path: Path) -> None:
    layout = CollectionLayout(tmp_path)
    store(layout.rig(3).root, frames=2)
    layout.scene.write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"is a collection; view one of its datasets: .*rig_00003"):
        open_frames(tmp_path, slice(None))


def test_the_object_touches_the_beam(viewed: ViewedDataset) -> None:
    bodies = Bodies(viewed.truth, viewed.trials)
    assert bodies.reason == ""
    for frame in viewed:
        meshes = dict(bodies.of_frame(frame.row["trial"]))
        assert set(meshes) == {"object", "hub"}
        contact = 1e-3 * np.array(frame.row["contact_antenna_mm"])
        # The contact is on the centreline, a radius of the beam, 0.4 mm, from the edge.
        triangles = np.asarray(meshes["object"].triangles)
        nearest = closest_point(  # type: ignore[no-untyped-call]
            triangles, np.tile(contact, (len(triangles), 1))
        )
        distance = np.linalg.norm(nearest - contact, axis=1).min()
        assert distance == pytest.approx(0.4e-3, abs=1e-6)
    lines = np.array(bodies.board_lines())
    assert lines.shape == (24 + 9, 2, 3)
    assert np.ptp(lines[..., 0]) == pytest.approx(230)


def test_the_reason_is_stated_if_no_body_can_be_built(tmp_path: Path) -> None:
    truth = open_truth(store(tmp_path / "set") / "truth")
    bodies = Bodies(truth, [0])
    assert "exactly one of pushes and sampling" in bodies.reason
    assert list(bodies.of_frame(0)) == []
    assert bodies.board_lines() == []
