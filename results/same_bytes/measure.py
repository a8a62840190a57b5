"""Compare images that are rendered with vectors of different widths, as on different processors.

One frame of every shipped scene, and of some rigs of the random ones, is rendered in processes of
their own: with vectors of 8 values, the reference target, and of 4 and 16. The same radiance is
exposed with 8, 10, 12 and 16 bits. The table has, for each width against 8, the fraction of pixels
that differ, the largest difference in gray values, the root mean square of the differences over
that of the sensor's noise.

    python results/same_bytes/measure.py                rows that are missing in the table
    python results/same_bytes/measure.py --part 2/4     a quarter of the scenes
    python results/same_bytes/measure.py --again        all, whatever the table has

All scenes take about an hour on two cores.
"""

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

FOLDER: Final = Path(__file__).parent
TABLE: Final = FOLDER / "same_bytes.csv"
REFERENCE: Final = 8
# Vectors of 16 values need AVX-512.
WIDTHS: Final = (4, 16)
BITS: Final = (8, 10, 12, 16)
RIGS: Final = range(3)
# The variable that tests use for the same purpose (vbaa_bench/dataset/target.py).
_WIDTH: Final = "VBAA_BENCH_VECTOR_WIDTH"
_LIMIT_S: Final = 1800


class Case(NamedTuple):
    """A scene by its path below scenes/, and the number of a rig of a random scene."""

    scene: str
    rig: int


class Row(NamedTuple):
    """Differences of one image from that of the reference target."""

    scene: str
    rig: int
    width: int
    bits: int
    pixels: int
    differ_ppm: float
    largest_gray: int
    rms_over_noise: float
    samples_differ_ppm: float
    failure: str


def cases() -> list[Case]:
    """List all scenes, and some rigs of the random ones."""
    from vbaa_bench.scene.shipped import shipped_scene_files, shipped_scenes

    names = [path.relative_to(shipped_scenes()).as_posix() for path in shipped_scene_files()]
    return [Case(n, rig) for n in names for rig in (RIGS if n.startswith("random/") else (0,))]


def render(case: Case, out: Path) -> None:
    """Render the frame in the middle of a scene; save its images and the sensor's noise."""
    from vbaa_bench.assembly.plan import accepted_rig, plan
    from vbaa_bench.dataset.target import FAST
    from vbaa_bench.generation.frame_renderer import METERED, FrameRenderer, metered_frames
    from vbaa_bench.scene.frames import Frames
    from vbaa_bench.scene.load import load_scene
    from vbaa_bench.scene.shipped import shipped_scenes

    file = accepted_rig(load_scene(shipped_scenes() / case.scene), case.rig)
    frames = Frames(file.scene)
    middle = frames.count // 2
    indices = {middle, *METERED} & set(range(frames.count))
    planned = plan(file, pushes={frames.push_of(index) for index in indices})
    specs = list(planned.frame_specs)
    renderer = FrameRenderer(file.scene, planned.rig, file.path.parent.resolve(), FAST, 1)
    metering = renderer.meter(metered_frames(specs))
    spec = next(spec for spec in specs if spec.index == middle)
    _, rendered = renderer.expose_frame(spec, metering)
    sensor, light = renderer.sensor(metering.exposure), renderer.vignetting
    saved: dict[str, Any] = {"samples": rendered.samples}
    for bits in BITS:
        change: dict[str, Any] = {"bits": bits}
        if file.scene.sensor.kind != "ideal":
            change |= {"gain": None}
        one = replace(sensor, **change)
        saved[f"image_{bits}"] = one.expose(
            light * rendered.radiance, np.random.default_rng(1), light**2 * rendered.variance
        )
        sigma = one.noise_sigma(light * rendered.radiance)
        full = float(one.radiance(np.array([[2**bits - 1]]))[0, 0])
        saved[f"noise_{bits}"] = np.sqrt(np.mean(sigma**2)) / full * (2**bits - 1)
    np.savez(out, **saved)


def rendered_apart(case: Case, width: int, out: Path) -> str:
    """Render in a process of its own; return why it failed, empty if it did not."""
    command = [sys.executable, __file__, "--render", case.scene, str(case.rig), str(out)]
    environment = {**os.environ, _WIDTH: str(width)}
    try:
        ended = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return f"takes more than {_LIMIT_S} s"
    lines = ended.stderr.strip().splitlines() or [f"exit status {ended.returncode}"]
    return lines[-1] if ended.returncode else ""


def compare(case: Case, folder: Path) -> list[Row]:
    """Render a scene with all widths and compare the images."""
    rows = list[Row]()
    reference = folder / "reference.npz"
    failure = rendered_apart(case, REFERENCE, reference)
    for width in WIDTHS:
        other = folder / f"{width}.npz"
        failure = failure or rendered_apart(case, width, other)
        if failure:
            rows.append(Row(*case, width, 0, 0, 0.0, 0, 0.0, 0.0, failure))
            continue
        one, two = np.load(reference), np.load(other)
        samples = round(1e6 * float(np.mean(one["samples"] != two["samples"])), 1)
        for bits in BITS:
            difference = one[f"image_{bits}"].astype(float) - two[f"image_{bits}"]
            rms = float(np.sqrt(np.mean(difference**2)) / one[f"noise_{bits}"])
            differ = 1e6 * float(np.mean(difference != 0))
            largest = int(np.abs(difference).max())
            image = case.scene, case.rig, width, bits, difference.size
            rows.append(Row(*image, round(differ, 1), largest, round(rms, 6), samples, ""))
    return rows


def read() -> list[dict[str, str]]:
    """Read the rows of the table; none if there is no table."""
    if not TABLE.is_file():
        return []
    with TABLE.open(newline="") as file:
        return list(csv.DictReader(file))


def write(rows: Iterable[dict[str, str]]) -> None:
    """Write the table, sorted by scene, rig, width and bits."""
    key = lambda row: (row["scene"], *(int(row[k]) for k in ("rig", "width", "bits")))  # noqa: E731
    part = TABLE.with_suffix(".part")
    with part.open("w", newline="") as file:
        writer = csv.DictWriter(file, Row._fields, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=key))
    part.replace(TABLE)


def main() -> int:
    """Measure the missing rows; return 1 if a scene failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--part", default="1/1", help="one of several parts, as 2/4")
    parser.add_argument("--again", action="store_true", help="measure all rows again")
    parser.add_argument("--scene", help="only scenes whose path contains this")
    parser.add_argument("--render", nargs=3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.render:
        scene, rig, out = chosen.render
        render(Case(scene, int(rig)), Path(out))
        return 0
    number, total = map(int, chosen.part.split("/"))
    done = set() if chosen.again else {(row["scene"], int(row["rig"])) for row in read()}
    todo = [c for c in cases()[number - 1 :: total] if tuple(c) not in done]
    todo = [c for c in todo if not chosen.scene or chosen.scene in c.scene]
    for count, case in enumerate(todo, 1):
        print(f"{count} of {len(todo)}: {case.scene}, rig {case.rig}", flush=True)
        with tempfile.TemporaryDirectory(prefix="vbaa-same-") as folder:
            new = compare(case, Path(folder))
        kept = [r for r in read() if (r["scene"], int(r["rig"])) != tuple(case)]
        write([*kept, *({k: str(v) for k, v in row._asdict().items()} for row in new)])
        for row in new:
            print("  ", *row[2:], flush=True)
    return int(any(row["failure"] for row in read()))


if __name__ == "__main__":
    sys.exit(main())
