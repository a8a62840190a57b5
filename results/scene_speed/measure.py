"""Measure what every scene of a folder costs on one core.

Each scene is measured in a fresh process with a time limit, so that a scene that fails is a row
with its reason. Costs are kept in the output folder, in one file per scene, variant and version of
the code, so that a second run only measures the others.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from results.scene_speed import cost as scene_cost
from results.scene_speed.table import SceneSpeed, compared, csv, markdown
from solver.instrument.errors import InputError
from solver.instrument.files import sha256, write_text
from solver.instrument.hashes import digest
from vbaa_bench.dataset.identity import dataset_identity
from vbaa_bench.scene.load import load_scene

_ROOT: Final = Path(__file__).parents[2]
# One thread for every library: times are of one core.
_ONE_THREAD: Final = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "OPENCV_FOR_THREADS_NUM": "1",
    "POLARS_MAX_THREADS": "1",
}

Record = dict[str, Any]
Progress = Callable[[int, int], None]


def measure(
    scenes: Mapping[str, Path], out: Path, variant: str, limit_s: float, progress: Progress
) -> list[SceneSpeed]:
    """Measure all scenes, given by name; the frame of largest cost comes first.

    Writes scene_speed.csv and scene_speed.md to `out`. `progress(done, total)` counts the scenes
    whose costs are not kept from an earlier run. A scene that failed is only measured again with a
    longer limit. Raises InputError if `out` cannot be written.
    """
    try:
        (out / "measured").mkdir(parents=True, exist_ok=True)
        costs = _measure_missing(scenes, out / "measured", variant, limit_s, progress)
        speeds = compared([SceneSpeed(name, **costs[name]) for name in scenes])
        write_text(out / "scene_speed.csv", csv(speeds))
        write_text(out / "scene_speed.md", markdown(speeds))
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from error
    return speeds


def _measure_missing(
    scenes: Mapping[str, Path], folder: Path, variant: str, limit_s: float, progress: Progress
) -> dict[str, Record]:
    """Measure the scenes whose costs are not in the folder, and add them; return all costs."""
    costs, missing = dict[str, Record](), dict[str, Path]()
    for name, path in scenes.items():
        try:
            kept = folder / f"{_identity(path, variant)}.json"
        except InputError as error:
            costs[name] = {"reason": "; ".join(str(error).splitlines())}
            continue
        costs[name] = _read(kept, limit_s)
        if not costs[name]:
            missing[name] = kept
    progress(0, len(missing))
    for number, (name, kept) in enumerate(missing.items()):
        costs[name] = measure_apart(scenes[name], variant, limit_s)
        write_text(kept, json.dumps({"limit_s": limit_s, "costs": costs[name]}))
        progress(number + 1, len(missing))
    return costs


def _identity(path: Path, variant: str) -> str:
    """Compute the digest of all that a scene's costs depend on, except the machine."""
    identity = dataset_identity(load_scene(path), variant)
    return digest(json.dumps([identity, sha256(Path(scene_cost.__file__))]).encode())


def _read(kept: Path, limit_s: float) -> Record:
    """Read the costs of an earlier run; none if they may be complete within a longer limit."""
    if not kept.is_file():
        return {}
    record = json.loads(kept.read_bytes())
    costs: Record = record["costs"]
    return {} if "reason" in costs and record["limit_s"] < limit_s else costs


def measure_apart(path: Path, variant: str, limit_s: float) -> Record:
    """Measure a scene in a fresh process; if it fails, the record has the `reason`."""
    command = [sys.executable, "-m", scene_cost.__name__, str(path.resolve()), variant]
    environment = {**os.environ, **_ONE_THREAD}
    try:
        with tempfile.TemporaryDirectory(prefix="vbaa-speed-") as folder:
            ended = subprocess.run(
                [*command, folder],
                cwd=_ROOT,
                env=environment,
                capture_output=True,
                timeout=limit_s,
                check=False,
            )
    except subprocess.TimeoutExpired as error:
        output, reason = error.stdout or b"", f"takes more than {limit_s:g} s"
    else:
        output, reason = ended.stdout, ""
        if ended.returncode:
            message = ended.stderr.decode(errors="replace").strip().splitlines()
            reason = (message or [f"the process ended with status {ended.returncode}"])[-1]
    record: Record = {"reason": reason} if reason else {}
    for line in output.splitlines():
        record |= json.loads(line)
    return record
