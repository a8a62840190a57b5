"""Fuzzed laboratories: rig.json, metadata.csv and images, from opening to the set-up."""

import json
import random
import shutil
from pathlib import Path
from typing import Any

import polars as pl

from solver.instrument.observation import Observations, open_observations
from solver.lab.target import svg
from solver.set_up import set_up
from tests.robustness.fuzz.columns import csv_bytes, mutated_table
from tests.robustness.fuzz.damage import damaged
from tests.robustness.fuzz.documents import json_bytes
from tests.robustness.fuzz.pictures import picture
from tests.robustness.fuzz.trees import mutated

# Keys that a rig.json may have, and that the small dataset's has not.
_OPTIONAL: Any = {
    "beam": {"sag_mm": 0.1, "known_psi_deg": 10.0},
    "board": {"kind": "charuco", "dictionary": "4X4_50", "line_width_mm": 1.0},
    "camera": {"camera_shift_sigma_px": 0.1, "bits": 8, "channel": "r", "mount": "world"},
    "light": {"slope": 0.1, "slope_sigma": 0.1, "distance_mm": 300.0, "across": 0.5},
    "moment_sensor": {"sigma_n_mm": 0.1},
    "force_sensor": {"force_sigma_n": 0.1, "moment_sigma_n_mm": 0.1},
    "beam_shape": {
        "taper_sigma": 0.02,
        "section_sigma": 0.02,
        "friction_sigma": 0.2,
        "rigid_objects": True,
        "bow_sigma_mm": 0.1,
        "friction_coefficient": 0.3,
        "clamp_softness": 0.001,
        "clamp_softness_sigma": 0.001,
        "rigidity_sigma": 0.01,
        "widths": [-0.03],
        "bow": [0.001, 0.0, 0.0],
        "covariance": [[1e-6 * (i == j) for j in range(5)] for i in range(5)],
    },
}


class Rigs:
    """Mutates a laboratory's folder of observations, without hashes, and sets the antenna up."""

    def __init__(self, material: Path) -> None:
        """Read the observations of `material`/dataset, and compile what a set-up needs."""
        self._tree = material / "dataset" / "observations"
        self._rig = json.loads((self._tree / "rig.json").read_bytes())
        self._table = pl.read_csv(self._tree / "shard_00000" / "metadata.csv", infer_schema=False)
        set_up(open_observations(self._tree))

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Copy the folder with mistakes in one or two files, open it, and set the antenna up."""
        root = folder / "observations"
        shutil.copytree(self._tree, root, ignore=shutil.ignore_patterns("hashes.json"))
        for _ in range(chance.choice((1, 1, 2))):
            chance.choice((self._rig_file, self._rig_file, self._metadata, self._image))(
                chance, root
            )
        self._use(open_observations(root))

    def _use(self, observations: Observations) -> None:
        svg(observations.rig.board)
        for frame in observations:
            frame.image()
        set_up(observations)

    def _rig_file(self, chance: random.Random, root: Path) -> None:
        path = root / "rig.json"
        if chance.random() < 0.15:
            path.write_bytes(damaged(path.read_bytes(), chance))
        else:
            path.write_bytes(json_bytes(mutated(self._rig, chance, [_OPTIONAL, self._rig]), chance))

    def _metadata(self, chance: random.Random, root: Path) -> None:
        path = root / "shard_00000" / "metadata.csv"
        path.write_bytes(csv_bytes(mutated_table(self._table, chance), chance))

    def _image(self, chance: random.Random, root: Path) -> None:
        path = chance.choice(sorted(root.glob("*/*.png")))
        choice = chance.randrange(6)
        if choice == 0:
            path.unlink()
        elif choice == 1:
            path.write_bytes(chance.choice(sorted(root.glob("*/*.png"))).read_bytes())
        else:
            path.write_bytes(picture(path.read_bytes(), chance))
