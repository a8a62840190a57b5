"""BOP-like folders: images, cameras and rigid poses as JSON, after the BOP benchmark for 6D poses.

OUT/
  models/models_info.json                   sizes of the beam of each rig, in mm
  <split>/000000/gray/000000.png            one scene per rig and at most 1,000 frames
  <split>/000000/mask_visib/000000_000000.png   where the beam is, if the truth has `beam_mask`
  <split>/000000/scene_camera.json          intrinsics, by image
  <split>/000000/scene_gt.json              poses: of the clamp, and of the contact
  <split>/000000/scene_gt_info.json         visible pixels of the beam
  <split>/000000/scene_vbaa.json            frame id, readings and labels, by image; not of BOP

Source of the layout: bop_toolkit, `docs/bop_datasets_format.md`.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np

from solver.instrument.files import write_bytes, write_text
from solver.instrument.images import png_bytes
from vbaa_bench.dataset.exr import read_exr
from vbaa_bench.exports.bop_poses import beam_id, pose_errors, poses
from vbaa_bench.exports.columns import SHARD
from vbaa_bench.exports.format import Exported, Format
from vbaa_bench.exports.output import Record
from vbaa_bench.exports.parts import Cut, Frame, Part
from vbaa_bench.exports.rig import Rig
from vbaa_bench.exports.source import Source

# Images per scene. Chosen: the number in most scenes of BOP.
_SCENE_FRAMES: Final = 1000
# BOP's values for what was not measured.
_NO_BOX: Final = [-1, -1, -1, -1]
_UNKNOWN: Final = {
    "bbox_obj": _NO_BOX,
    "bbox_visib": _NO_BOX,
    "px_count_all": -1,
    "px_count_valid": -1,
    "px_count_visib": -1,
    "visib_fract": -1,
}


class Bop(Format):
    """One folder per scene of BOP."""

    usual_cut: ClassVar = Cut(10**12, most_frames=_SCENE_FRAMES, one_rig=True)
    layout: ClassVar = """\
- `<split>/<scene>/`: as in BOP, `gray/`, `scene_camera.json` (`cam_K`; the centre of a pixel has
  integer coordinates), `scene_gt.json` (`cam_R_m2c`, `cam_t_m2c` in mm), `scene_gt_info.json`, and
  `mask_visib/` if the dataset has masks. What is unknown is -1: BOP's full masks and boxes.
- `models/models_info.json`: sizes in mm. There are no meshes: the beam bends.
- Not of BOP: the beam is no rigid object. `obj_id` 2 i + 1 is the frame *clamp* of rig i; 2 i + 2
  is the contact: its origin is the contact point on the centreline, y is the direction of the force
  on the beam, and x is that of the part of the clamp's x that is perpendicular to y.
  `cam_distortion` in `scene_camera.json` has the lens distortion in OpenCV's order.
  `scene_vbaa.json` has the frame id, the readings and the labels of each image."""
    loading: ClassVar = """\
import json

scene = "{split}/000000"
camera = json.load(open(f"{scene}/scene_camera.json"))["0"]["cam_K"]
poses = json.load(open(f"{scene}/scene_gt.json"))["0"]
"""

    def refusal(self, source: Source) -> str:
        """Say why not: a telecentric camera."""
        if any(rig.camera.telecentric for rig in source.rigs.values()):
            return "its camera is telecentric, BOP has only pinhole cameras"
        return ""

    def write_part(self, folder: Path, part: Part) -> Record:
        """Write one scene."""
        scene = folder / part.split / f"{part.number:06d}"
        (scene / "gray").mkdir(parents=True, exist_ok=True)
        cameras, ground_truth, info, ours = {}, {}, {}, {}
        for number, frame in enumerate(part.frames()):
            rig_number = list(part.source.rigs).index(frame.rig.name)
            write_bytes(scene / "gray" / f"{number:06d}.png", frame.png)
            image = str(number)
            cameras[image] = _camera(frame.rig)
            ground_truth[image] = poses(frame.rig, frame.row, rig_number)
            visible = {**_UNKNOWN, **_visible(scene, number, frame)}
            info[image] = [visible, *[_UNKNOWN for _ in ground_truth[image][1:]]]
            values = {name: value for name, value in frame.row.items() if name != SHARD}
            ours[image] = {"key": frame.key, **values}
        for name, content in (
            ("scene_camera", cameras),
            ("scene_gt", ground_truth),
            ("scene_gt_info", info),
            ("scene_vbaa", ours),
        ):
            write_text(scene / f"{name}.json", _by_line(content))
        return {}

    def finish(self, folder: Path, source: Source, _records: Sequence[Record]) -> None:
        """Write the sizes of the beams."""
        models = {}
        for number, rig in enumerate(source.rigs.values()):
            beam = rig.truth.manifest["true_rig"]
            length, radius = beam["beam_length_mm"], beam["beam_diameter_mm"] / 2
            models[str(beam_id(number))] = {
                "diameter": float(np.hypot(length, 2 * radius)),
                **dict(zip(("min_x", "min_y", "min_z"), (0.0, -radius, -radius), strict=True)),
                "size_x": length,
                **dict.fromkeys(("size_y", "size_z"), 2 * radius),
            }
        (folder / "models").mkdir(exist_ok=True)
        write_text(folder / "models" / "models_info.json", json.dumps(models, indent=2) + "\n")

    def read_back(self, folder: Path, source: Source) -> Iterator[Exported]:
        """Read the images and our values of every scene, in the order of their numbers."""
        for split in source.splits:
            for scene in sorted((folder / split).iterdir()):
                ours = json.loads((scene / "scene_vbaa.json").read_bytes())
                for image, values in ours.items():
                    data = (scene / "gray" / f"{int(image):06d}.png").read_bytes()
                    yield Exported(values.pop("key"), split, data, values)

    def structure_errors(self, folder: Path, source: Source) -> Iterator[str]:
        """Check that the files of a scene list the same images, and its poses."""
        for scene in sorted(path.parent for path in folder.glob("*/*/scene_vbaa.json")):
            names = ("scene_vbaa", "scene_camera", "scene_gt", "scene_gt_info")
            files = [json.loads((scene / f"{name}.json").read_bytes()) for name in names]
            for name, content in zip(names[1:], files[1:], strict=True):
                if content.keys() != files[0].keys():
                    yield f"{scene.name}/{name}.json: lists other images than scene_vbaa.json"
            for image, values in files[0].items():
                rig = source.rigs[values["rig"]]
                for error in pose_errors(rig, values, files[1][image], files[2][image]):
                    yield f"{scene.name}, image {image}: {error}"


def _camera(rig: Rig) -> dict[str, Any]:
    camera = rig.camera
    intrinsics = {"cam_K": camera.matrix.ravel().tolist(), "depth_scale": 1.0}
    return {**intrinsics, "cam_distortion": list(camera.distortion)}


def _visible(scene: Path, number: int, frame: Frame) -> dict[str, Any]:
    """Write the mask of the visible beam, if the truth has one, and measure it."""
    share, mask = frame.row["visible_share"], _mask(frame)
    measured: dict[str, Any] = {} if share is None else {"visib_fract": share}
    if mask is not None:
        (scene / "mask_visib").mkdir(exist_ok=True)
        image = np.where(mask, 255, 0).astype(np.uint8)
        write_bytes(scene / "mask_visib" / f"{number:06d}_000000.png", png_bytes(image))
        measured["px_count_visib"] = int(mask.sum())
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if rows.size:
            u, v = int(columns[0]), int(rows[0])
            size = [int(columns[-1]) - u + 1, int(rows[-1]) - v + 1]
            measured["bbox_visib"] = [u, v, *size]
    return measured


def _mask(frame: Frame) -> Any:
    """Read the beam's mask; None if the scene has no such layer."""
    if "beam_mask" not in frame.rig.stated("layers"):
        return None
    layout, row = frame.rig.layout, frame.row
    folder = layout.shard(layout.truth, row[SHARD])
    return read_exr(folder / f"{row['frame_id']}.exr")["beam_mask"] > 0.5


def _by_line(content: dict[str, Any]) -> str:
    """Format an object with one line per image."""
    lines = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in content.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"
