"""Fuzzed JSON files of a dataset: manifest, identity, hashes, summary, budget, baseline."""

import json
import random
from pathlib import Path
from typing import Final

from tests.robustness.fuzz.damage import damaged
from tests.robustness.fuzz.datasets import copied, replaced
from tests.robustness.fuzz.documents import json_bytes
from tests.robustness.fuzz.trees import mutated
from tests.robustness.fuzz.uses import USES, compare, report, store_baseline, warm_up
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.identity import check_identity, dataset_identity
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.scene.load import load_scene, recorded_scene

_FILES: Final = (
    *("truth/manifest.json", "truth/manifest.json", "truth/identity.json", "truth/hashes.json"),
    *("truth/shard_00000/hashes.json", "observations/hashes.json", "scores/summary.json"),
    *("observations/shard_00000/hashes.json", "baseline.json", "baseline.json", "collection.json"),
    "derived/budget.json",
)
_BUDGET: Final = {
    "exact_fit": {
        cause: {"bias_pct_L": 0.1, "rmse_pct_L": 0.2, "low": 0.1, "high": 0.3}
        for cause in ("total", "noise", "remainder")
    }
}


class Records:
    """Replaces a JSON file of a dataset, and runs a command that reads it."""

    def __init__(self, material: Path) -> None:
        """Find the valid files of `material`."""
        warm_up(material)
        self._material = material
        self._scene = load_scene(material / "dataset.yaml")
        self._identity = dataset_identity(self._scene, "scalar_rgb")

    def attempt(self, chance: random.Random, folder: Path) -> None:
        """Copy a dataset with mistakes in one JSON file, and use it."""
        name = chance.choice(_FILES)
        source = self._material / ("collection" if name == "collection.json" else "dataset")
        root = copied(source, folder / "data")
        path = folder / name if name == "baseline.json" else root / name
        valid = self._valid(name, path)
        data = valid
        if chance.random() < 0.2:
            data = damaged(valid, chance)
        else:
            document = json.loads(valid)
            data = json_bytes(mutated(document, chance, [document]), chance)
        path.parent.mkdir(exist_ok=True)
        replaced(root, path, data, sealed=chance.random() < 0.9)
        self._use(name, chance, root, path)

    def _valid(self, name: str, path: Path) -> bytes:
        if name == "derived/budget.json":
            return json.dumps(_BUDGET).encode()
        return (self._material / name if name == "baseline.json" else path).read_bytes()

    def _use(self, name: str, chance: random.Random, root: Path, path: Path) -> None:
        if name == "baseline.json":
            chance.choice((compare, report, store_baseline))(root, path)
        elif name == "truth/identity.json":
            check_identity(Layout(root), self._identity)
        elif name == "truth/manifest.json" and chance.random() < 0.5:
            scene = read_json(path).get("scene")
            if isinstance(scene, dict):
                recorded_scene(scene, path, root)
        else:
            chance.choice(tuple(USES.values()))(root)
