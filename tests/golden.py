"""Whether two versions of the project make the same: `make golden BASE=COMMIT`.

The command checks out BASE beside this version, lets each make the following in a folder of its
own, and names what differs. The exit status is 1 if anything does.

  datasets/NAME/   four frames of a scene with all layers, its boards and its rest images
  run/             `run` of the quickstart: dataset, limits, predictions, scores, report
  messages.txt     number, exit status and message of each of 300 damaged inputs

Files of datasets must have the same bytes, predictions and scores the same values, apart from
times; limits may differ by 1e-9 of themselves. This version must also read the run of BASE: check,
solve, score, report, export it, make a baseline of it and compare it with the one of BASE.

A version is made once: its folder, runs/golden/COMMIT, is kept. This version is made anew.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

ROOT: Final = Path(__file__).parent.parent
# Objects, occluders, sensors, grounds, paints and lamps of most kinds: scenes, and their pushes.
_STATED: Final = "contact_distance_mm: [110, 190], deflection_pct: [6, 16]"
SCENES: Final = {
    "fig11_stiffness": "contact_distance_mm: [140], stiffness_n_m: [5, rigid], "
    "pushing_angle_deg: [3, 9]",
    "fig6_unknown_psi": "contact_distance_mm: [110, 170], normal_deg: [20, 60], "
    "deflection_pct: [10]",
    "fig14_micro": "contact_distance_mm: [4, 8], deflection_pct: [2, 10]",
    "camera_moving": "contact_distance_mm: [90, 170], pushing_angle_deg: [-4, 8]",
    "camera/poor_sensor": _STATED,
    "camera/colour": _STATED,
    "looks/laboratory": _STATED,
    "objects/mesh": _STATED,
    "hard/two_pegs": "contact_distance_mm: [80, 140], pushing_angle_deg: [2, 8]",
    "hard/behind_leaves": _STATED,
    "lighting/environment": _STATED,
    "random/looks": "contact_distance_mm: [{uniform: [40, 222]}], "
    "deflection_pct: [{log_uniform: [1, 25]}], repeats: 4",
}
LAYERS: Final = (
    "layers=[radiance,variance,beam_mask,coverage,arc_length,depth,normal,object_index,occlusion]"
)
# Files that name the versions of packages and of the code, or hold hashes of those that do.
NAMES_THE_VERSION: Final = {"truth/identity.json", "truth/hashes.json"}
# Cases of each kind of input, of the fuzz with seed 1.
MESSAGES: Final = {
    "scenes": 120,
    "rigs": 50,
    "tables": 40,
    "images": 20,
    "predictions": 30,
    "records": 20,
    "settings": 20,
}
LIMITS_MAY_DIFFER: Final = 1e-9


def make(folder: Path) -> None:
    """Make everything of this version in a new folder."""
    for name, pushes in SCENES.items():
        options = ["--rigs", "0:2"] if name.startswith("random/") else []
        options += ["--set", f"pushes={{{pushes}}}", "--set", LAYERS]
        out = folder / "datasets" / name.replace("/", "_")
        _command("generate", f"scenes/{name}.yaml", "--out", out, *options)
    _command("run", "scenes/quickstart.yaml", "--out", folder / "run")
    _command("compare", folder / "run", folder / "baseline.json", "--save")
    _write_messages(folder)


def _command(*arguments: str | Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "vbaa_bench", *map(str, arguments)],
        cwd=ROOT,
        check=True,
        stdout=subprocess.DEVNULL,
    )


def _write_messages(folder: Path) -> None:
    counts = [option for kind, count in MESSAGES.items() for option in (f"--{kind}", str(count))]
    fuzz = folder / "fuzz"
    command = [sys.executable, "-m", "tests.robustness.fuzz", "--seed", "1", "--out", str(fuzz)]
    subprocess.run([*command, *counts], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    lines = (fuzz / "cases.jsonl").read_text("utf-8").splitlines()[1:]
    cases = sorted(json.loads(line) for line in lines)
    texts = [
        json.dumps([kind, number, outcome, _without_place(text, fuzz)])
        for kind, number, outcome, _seconds, _memory, text in cases
    ]
    (folder / "messages.txt").write_text("\n".join(texts) + "\n", "utf-8")
    shutil.rmtree(fuzz)


def _without_place(text: str, fuzz: Path) -> str:
    """Leave out the folder of the case and its process, and what a library says of the bytes.

    Files of results hold times: the same mistake meets other bytes in each run.
    """
    text = re.sub(rf"{re.escape(str(fuzz))}(/\w+/child_\d+/)?", "", text)
    return re.sub(r"\(.*\)", "(...)", text)


def differences(old: Path, new: Path) -> Iterator[str]:
    """Name what differs between the folders of two versions."""
    for tree in sorted({*_trees(old), *_trees(new)}):
        yield from _different_files(old, new, tree)
    for name in sorted(path.name for path in (old / "run/predictions").glob("*.csv")):
        yield from _different_tables(old / "run/predictions" / name, new / "run/predictions" / name)
    for name in ("run/scores/scores.csv", "run/scores/strata.csv", "run/derived/limits.parquet"):
        yield from _different_tables(old / name, new / name)
    yield from _different_documents(old, new, "run/scores/summary.json")
    before, after = ((root / "messages.txt").read_text("utf-8") for root in (old, new))
    for line, other in zip(before.splitlines(), after.splitlines(), strict=True):
        if line != other:
            yield f"message: {line}\n      now: {other}"


def _trees(folder: Path) -> set[str]:
    """List the trees of observations and of truth, by their paths below `folder`."""
    found = (folder.rglob(name) for name in ("observations", "truth"))
    return {str(path.relative_to(folder)) for paths in found for path in paths if path.is_dir()}


def _different_files(old: Path, new: Path, tree: str) -> Iterator[str]:
    names = {
        str(path.relative_to(folder))
        for folder in (old, new)
        for path in (folder / tree).rglob("*")
        if path.is_file()
    }
    for name in sorted(names):
        before, after = old / name, new / name
        if name.endswith(tuple(NAMES_THE_VERSION)):
            continue
        if not before.is_file() or not after.is_file():
            yield f"{name}: is in one version only"
        elif name.endswith("truth/manifest.json"):
            yield from _different_documents(old, new, name)
        elif before.read_bytes() != after.read_bytes():
            yield f"{name}: has other bytes"


def _different_documents(old: Path, new: Path, name: str) -> Iterator[str]:
    before, after = (_timeless(json.loads((root / name).read_text("utf-8"))) for root in (old, new))
    if before != after:
        yield f"{name}: holds other values"


def _timeless(value: Any) -> Any:
    """A document without times, versions and the machine."""
    if isinstance(value, dict):
        return {
            key: _timeless(child)
            for key, child in value.items()
            if key not in ("versions", "machine", "calibration") and not _is_time(key)
        }
    return [_timeless(child) for child in value] if isinstance(value, list) else value


def _is_time(name: str) -> bool:
    return "ms" in name.split("_")


def _different_tables(before: Path, after: Path) -> Iterator[str]:
    if not after.is_file():
        yield f"{after}: is missing"
        return
    read = pl.read_parquet if after.suffix == ".parquet" else _read_csv
    old, new = read(before), read(after)
    if old.columns != new.columns or old.height != new.height:
        yield f"{after}: has other columns or rows"
        return
    for name in old.columns:
        if not _is_time(name) and not _same(old[name], new[name], after.suffix == ".parquet"):
            yield f"{after}: {name} has other values"


def _read_csv(path: Path) -> pl.DataFrame:
    """All columns as text: what is written counts."""
    return pl.read_csv(path, infer_schema=False)


def _same(old: pl.Series, new: pl.Series, nearly: bool) -> bool:
    if not nearly or not old.dtype.is_float():
        return old.equals(new, null_equal=True)
    apart = np.isclose(
        old.to_numpy(), new.to_numpy(), rtol=LIMITS_MAY_DIFFER, atol=0.0, equal_nan=True
    )
    return bool(apart.all())


def read_old_run(old: Path, scratch: Path) -> Iterator[str]:
    """Use the dataset, the run and the baseline of an older version; name what cannot be read."""
    run = scratch / "run"
    shutil.copytree(old / "run", run)
    commands: list[list[str | Path]] = [
        *([name, run] for name in ("verify", "info", "limits")),
        ["solve", run, "--method", "exact_fit"],
        *([name, run] for name in ("score", "report", "table", "budget")),
        ["compare", run, old / "baseline.json"],
        ["compare", run, scratch / "baseline.json", "--save"],
        ["export", run, "--to", "csv", "--out", scratch / "csv"],
        ["subset", run, scratch / "subset", "--frames", "9"],
    ]
    for command in commands:
        done = subprocess.run(
            [sys.executable, "-m", "vbaa_bench", *map(str, command)],
            cwd=ROOT,
            check=False,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
            yield f"{command[0]} of the older run: exit status {done.returncode}, {last}"


def _made_by(commit: str, runs: Path) -> Path:
    """Let a commit make its folder, unless it has."""
    folder = runs / commit
    if not folder.is_dir():
        code, part = runs / "code", runs / "part"
        for path in (code, part):
            shutil.rmtree(path, ignore_errors=True)
        _git("worktree", "prune")
        _git("worktree", "add", "--quiet", "--detach", str(code), commit)
        try:
            environment = {**os.environ, "PYTHONPATH": str(code)}
            command = [sys.executable, "-m", "tests.golden", "--make", str(part)]
            subprocess.run(command, cwd=code, env=environment, check=True)
        finally:
            _git("worktree", "remove", "--force", str(code))
        part.rename(folder)
    return folder


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()


def main() -> int:
    """Compare this version with a commit, or make a version's folder."""
    parser = argparse.ArgumentParser(description="Compare what two versions make")
    parser.add_argument("base", nargs="?", help="commit to compare with")
    parser.add_argument("--make", type=Path, help="folder in which to make this version's files")
    options = parser.parse_args()
    if options.make:
        make(options.make)
        return 0
    runs = ROOT / "runs" / "golden"
    runs.mkdir(parents=True, exist_ok=True)
    old, new, scratch = (
        _made_by(_git("rev-parse", f"{options.base}^{{commit}}"), runs),
        runs / "here",
        runs / "scratch",
    )
    for folder in (new, scratch):
        shutil.rmtree(folder, ignore_errors=True)
    make(new)
    scratch.mkdir()
    found = [*differences(old, new), *read_old_run(old, scratch)]
    print("\n".join(found) or "nothing differs")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
