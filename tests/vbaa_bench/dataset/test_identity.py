"""A dataset is that of its images, not only of their names."""

from pathlib import Path

import cv2
import numpy as np

from tests.conftest import SMALL_SCENE
from vbaa_bench.dataset.identity import dataset_identity
from vbaa_bench.scene.load import load_scene

EXTRA = """
background: {pattern: image, image_file: table.png}
object: {kind: block, texture: {kind: image, file: label.png}}
"""


def test_images_of_surfaces_belong_to_the_identity(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + EXTRA, encoding="utf-8")
    identities = []
    for number in range(3):
        values = np.full((2, 2), 100, np.uint8)
        cv2.imwrite(str(tmp_path / "table.png"), values + (number == 1))
        cv2.imwrite(str(tmp_path / "label.png"), values + (number == 2))
        identities.append(dataset_identity(load_scene(path), "llvm_ad_mono")["files"])
    assert set(identities[0]) == {"table.png", "label.png"}
    first, *others = identities
    changed = [{name for name in first if first[name] != other[name]} for other in others]
    assert changed == [{"table.png"}, {"label.png"}]
