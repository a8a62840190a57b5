"""Render every shipped scene under the debug flag of Dr.Jit, and count what it reports.

With this flag, Dr.Jit checks the index of every value that a kernel reads, and writes a message for
each kernel and place in the code at which one is outside of its array. Of each scene, and of many
rigs of the random scenes, a frame, a rest image and a calibration board are rendered, each scene in
a process of its own. Noise targets are four times those of the scene: pixels have fewer samples,
but every pixel and every kernel is there.

    python results/debug_run/measure.py                rows of scenes that are missing in the table
    python results/debug_run/measure.py --part 2/4     a quarter of them
    python results/debug_run/measure.py --again        all, whatever the table has

The table is results/debug_run/debug_run.csv; the exit status is 1 if it has a message or a failure.
"""

import argparse
import csv
import dataclasses
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

FOLDER: Final = Path(__file__).parent
SCENES: Final = FOLDER.parents[1] / "scenes"
TABLE: Final = FOLDER / "debug_run.csv"
IMAGES: Final = ("frame", "rest", "board")
# Factor of the noise targets. Chosen: samples are 16 times fewer, and compilation takes longer.
_NOISE: Final = 4.0
# Processes that take longer are ended [s]. Chosen: ten times the longest.
_LIMIT_S: Final = 1800.0
_BEGINS: Final = "image begins: "


class Case(NamedTuple):
    """A scene by its path below scenes/, and the number of a rig of a random scene."""

    scene: str
    rig: int


class Row(NamedTuple):
    """Messages of Dr.Jit by image, and why an image is missing, empty if none is."""

    scene: str
    rig: int
    frame: int
    rest: int
    board: int
    seconds: float
    failure: str


def cases(rigs: int) -> list[Case]:
    """List all scenes, and `rigs` rigs of the random ones together."""
    files = [path for path in sorted(SCENES.rglob("*.yaml")) if path.parent.name != "suites"]
    names = [path.relative_to(SCENES).as_posix() for path in files]
    random = [name for name in names if name.startswith("random/")]
    plain = [Case(name, 0) for name in names if name not in random]
    return plain + [Case(random[i % len(random)], i // len(random)) for i in range(rigs)]


def measured(case: Case) -> Row:
    """Render a case in a process of its own, and count the messages by image."""
    start = time.monotonic()
    command = [sys.executable, __file__, "--render", case.scene, str(case.rig)]
    child = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    try:
        _, text = child.communicate(timeout=_LIMIT_S)
    except subprocess.TimeoutExpired:
        child.kill()
        _, text = child.communicate()
    image, last, messages = "start", "", Counter[str]()
    for line in text.splitlines():
        if line.startswith(_BEGINS):
            image = line.removeprefix(_BEGINS)
        elif line.strip():
            messages[image] += line.startswith("drjit.")
            last = line.strip()
    failure = f"{image}, exit status {child.returncode}: {last}" if child.returncode else ""
    seconds = round(time.monotonic() - start, 1)
    counts = messages["frame"], messages["rest"], messages["board"]
    return Row(case.scene, case.rig, *counts, seconds, failure[:200])


def render(case: Case) -> None:
    """Render the images of a case in this process, and name each on stderr before it begins."""
    import drjit as dr  # late: the process that counts needs no renderer

    from vbaa_bench.assembly.plan import accepted_rig
    from vbaa_bench.assembly.pushes import Pushes
    from vbaa_bench.dataset.target import FAST
    from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
    from vbaa_bench.scene.load import load_scene
    from vbaa_bench.scene.rigs import true_rig

    file = accepted_rig(load_scene(SCENES / case.scene), case.rig)
    spec = file.scene.render
    targets = ("noise_near_beam", "noise_elsewhere", "noise_static_layer")
    coarse = spec.model_copy(update={name: _NOISE * getattr(spec, name) for name in targets})
    file = dataclasses.replace(file, scene=file.scene.model_copy(update={"render": coarse}))
    rig = true_rig(file.scene)
    renderer = FrameRenderer(file.scene, rig, file.path.parent, FAST, threads=1)
    pushes = Pushes(file, rig, renderer.pushes)
    dr.set_flag(dr.JitFlag.Debug, True)
    exposure = renderer.measure_exposure()
    for image in IMAGES:
        print(f"{_BEGINS}{image}", file=sys.stderr, flush=True)
        match image:
            case "frame":
                renderer.frame(pushes.frame(0), Metering(exposure))
            case "rest":
                renderer.rest_image(0, exposure)
            case "board":
                renderer.board_image(0, exposure)


def table() -> dict[Case, Row]:
    """Read the rows of earlier runs."""
    if not TABLE.exists():
        return {}
    with TABLE.open(encoding="utf-8", newline="") as text:
        rows = [
            Row(name, int(rig), int(frame), int(rest), int(board), float(seconds), failure)
            for name, rig, frame, rest, board, seconds, failure in list(csv.reader(text))[1:]
        ]
    return {Case(row.scene, row.rig): row for row in rows}


def write(rows: Sequence[Row]) -> None:
    """Write the table anew."""
    with TABLE.open("w", encoding="utf-8", newline="") as text:
        lines = csv.writer(text, lineterminator="\n")
        lines.writerow(Row._fields)
        lines.writerows(sorted(rows))


def shown(rows: Sequence[Row]) -> Iterator[str]:
    """Yield a line for each row with a message or a failure, and one for all."""
    for row in rows:
        if row.frame or row.rest or row.board or row.failure:
            counts = ", ".join(f"{name} {getattr(row, name)}" for name in IMAGES)
            yield f"{row.scene} rig {row.rig}: {counts} {row.failure}"
    messages = sum(row.frame + row.rest + row.board for row in rows)
    failures = sum(bool(row.failure) for row in rows)
    yield f"{len(rows)} scenes and rigs, {messages} messages, {failures} failures"


def main() -> None:
    """Render what the table lacks, or one case if a process of this script asks for it."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--rigs", type=int, default=60, help="number of random rigs")
    parser.add_argument("--part", default="1/1", metavar="K/N", help="one of N equal parts")
    parser.add_argument("--again", action="store_true", help="render what the table has as well")
    parser.add_argument("--render", nargs=2, metavar=("SCENE", "RIG"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.render:
        render(Case(options.render[0], int(options.render[1])))
        return
    part, parts = map(int, options.part.split("/"))
    chosen = cases(options.rigs)[part - 1 :: parts]
    for case in chosen:
        if options.again or case not in table():
            row = measured(case)
            write([*(table() | {case: row}).values()])
            print(*row, flush=True)
    rows = [row for case, row in table().items() if case in chosen]
    print("\n".join(shown(rows)))
    sys.exit(any(row.frame or row.rest or row.board or row.failure for row in rows))


if __name__ == "__main__":
    main()
