"""Random scenes with random mistakes are loaded and drawn, or refused with a sentence.

`python -m tests.vbaa_bench.scene.test_fuzzed_random_scenes 5000` tries more of them.
"""

import random
import re
import sys
import tempfile
from pathlib import Path

from solver.instrument.errors import InputError
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.random_scene import RejectedDrawError

SCENE = """\
title: Random
seed: 5
rigs: 3
random_method: sobol
beam:
  length_mm: {uniform: [200, 260]}
  paint: {choice: [gloss, bare], weights: [1, 2]}
  bow_mm: {normal: [0, 1], clip: [-2, 2]}
object:
  choice:
  - {kind: peg, radius_mm: {log_uniform: [1, 3]}}
  - {kind: block, side_mm: {from: beam.length_mm, times: {uniform: [0.04, 0.08]}}}
  per: push
background:
  reflectance: {uniform: [0.02, 0.3], per: frame}
calibration: {views: {integers: [4, 8]}}
optics: {vignetting_pct: {from: optics.point_spread_px, plus: 3}}
pushes:
  contact_distance_mm: [100, {uniform: [120, 180]}]
  deflection_pct: [{uniform: [3, 10]}]
splits: {shares: {train: 0.5, test: 0.5}}
light_level: {normal: [1, 0.1], clip: [0.8, 1.2], per: frame}
"""
# One mistake, or none, in place of a value; separated by two spaces.
ODD = (
    """
{uniform: [1, 2]}  {uniform: [2, 1]}  {uniform: 3}  {uniform: [a, b]}  {uniform: []}
{log_uniform: [-1, 2]}  {integers: [1, 5]}  {integers: [1.5, 2]}  {normal: [0, 1]}
{normal: [0, -1], clip: [0, 1]}  {choice: []}  {choice: {a: 1}}  {choice: [[], {}, 1]}
{choice: [1, x, null], per: frame}  {from: beam.length_mm}  {from: seed, times: x}  {from: 7}
{from: a.b.c}  {from: object}  {from: beam.length_mm, times: {choice: [a]}}  null  []  {}  -1
{uniform: [1, 2], choice: [3]}  {uniform: [[1, 2], [3, 4]]}  {uniform: [[1], [2, 3]]}  1e99  x
{uniform: [1, 2], per: week}  {uniform: [1, .inf]}  {choice: [{choice: [{choice: [1]}]}]}
{choice: [{uniform: [1, 2], per: frame}], per: push}  per: frame  per: rig
{from: background.reflectance}  {from: light_level, per: frame}  {integers: [1, 9], per: push}
{uniform: [0.1, 0.2]}  {choice: [matt, gloss]}  {choice: [1], weights: [0]}  {from: beam.bow_mm.x}
""".replace("\n", "  ")
    .strip()
    .split("  ")
)


def attempt(path: Path, seed: int) -> bool:
    """Load a scene with some mistakes and draw from it; return whether it was refused."""
    chance = random.Random(seed)
    lines = SCENE.split("\n")
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(lines))
        key, _, value = lines[at].partition(":")
        odd, other = chance.choice(ODD), chance.choice(lines)
        start = chance.randrange(len(lines[at]) + 1)
        decimal = re.sub(r"\d+\.\d+", f"{chance.uniform(0.1, 3):.3g}", value)
        whole = re.sub(r"\b[2-9]\b", str(chance.randint(1, 9)), value)
        lines[at] = chance.choice(
            [
                *(f"{key}: {odd}", f"{key}:{value}\n{other}", f"{lines[at][:start]}{odd}"),
                *(other, "", f"{key}:{decimal}", f"{key}:{whole}", f"{key}:{whole}"),
            ]
        )
    path.write_text("\n".join(lines), encoding="utf-8")
    try:
        file = load_scene(path)
        scene = file.rig(1).scene
        Frames(scene).of_push(0)
    except InputError:
        return True
    except RejectedDrawError:
        return False
    return False


def test_fuzzed_random_scenes_are_loaded_or_refused(tmp_path: Path) -> None:
    refused = [attempt(tmp_path / "scene.yaml", seed) for seed in range(60)]
    assert 20 < sum(refused) < 55


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        count = int(sys.argv[1])
        results = [attempt(Path(folder) / "scene.yaml", seed) for seed in range(count)]
        print(f"{count} scenes: {sum(results)} refused, {count - sum(results)} loaded")
