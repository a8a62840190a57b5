"""Arguments and options that commands share."""

from pathlib import Path
from typing import Annotated, Final

import typer

from solver.instrument.errors import InputError
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.report.console import print_line
from vbaa_bench.scene.shipped import find_scene
from vbaa_bench.scoring.conditions import CONDITIONS, STRATA
from vbaa_bench.scoring.results_layout import USUAL_CENTRELINE

# Copied for help texts, because importing the originals takes seconds. A test compares them.
METHODS: Final = (
    "two_point",
    "three_point",
    "moment_sensor",
    "stiffness",
    "linear_fit",
    "exact_fit",
    "exact_fit_3d",
    "exact_fit_learned",
    "two_contact_fit",
    "hung_weight",
    "push_fit",
    "push_fit_friction",
    "force_sensor",
)
CENTRELINES: Final = ("profile_fit", "background_subtracted", "area_weighted")
# Memory limit of a method [GB].
MEMORY_GB: Final = 8.0


def _checked_centrelines(centrelines: list[str] | None) -> list[str] | None:
    """Reject an unknown name before anything is rendered. Raises InputError."""
    for name in centrelines or []:
        if name not in CENTRELINES:
            raise InputError(
                f"centreline '{name}' is unknown, allowed is one of {', '.join(CENTRELINES)}"
            )
    return centrelines


def checked_path(path: Path | None) -> Path | None:
    """Reject an invalid file name before minutes of work. Raises InputError."""
    try:
        if path is not None:
            path.exists()
    except OSError as error:
        raise InputError(f"{path}: is not a file or folder name ({error.strerror})") from error
    return path


def checked_paths(paths: list[Path] | None) -> list[Path] | None:
    """Reject an invalid file name before minutes of work. Raises InputError."""
    for path in paths or []:
        checked_path(path)
    return paths


def _named_scene(path: Path | None) -> Path | None:
    """Find the file of a scene; say which one, if it was named. Raises InputError."""
    if path is None:
        return None
    found = find_scene(path)
    if found != path:
        print_line(f"scene: {found}")
    return found


def _named_source(path: Path) -> Path:
    """Find a dataset, or the file of a scene. Raises InputError."""
    checked_path(path)
    return path if path.exists() else _named_scene(path) or path


def parsed_range(text: str) -> slice | None:
    """Parse 7, 3:7 (3 to 6), 3: (from 3) or :7 (to 6); None if the text is no such range."""
    first, colon, last = text.partition(":")
    if not all(part == "" or part.isdecimal() for part in (first, last)) or text in ("", ":"):
        return None
    start = int(first or 0)
    if not colon:
        return slice(start, start + 1)
    return slice(start, int(last) if last else None)


def _use_modules(names: list[str] | None) -> None:
    """Use the kinds of users' modules before a scene is read. Raises InputError."""
    if names:
        with importing():
            from vbaa_bench.scene.user_modules import use_module
        for name in names:
            use_module(name)


def rig_numbers(text: str | None, count: int) -> range:
    """Parse the numbers of rigs, such as 7 or 3:7, of a scene with `count`. Raises InputError."""
    if text is None:
        return range(count)
    chosen = parsed_range(text)
    if chosen is not None:
        numbers = range(chosen.start, count if chosen.stop is None else chosen.stop)
        if numbers and numbers.stop <= count:
            return numbers
    raise InputError(f"--rigs is {text}, allowed is a number or a range within 0:{count}")


def part_of(text: str | None) -> tuple[int, int] | None:
    """Parse a part such as 2/5. Raises InputError."""
    if text is None:
        return None
    number, _, count = text.partition("/")
    if number.isdigit() and count.isdigit() and 1 <= int(number) <= int(count):
        return int(number), int(count)
    raise InputError(f"--part is {text}, allowed is NUMBER/COUNT, from 1/COUNT to COUNT/COUNT")


ScenePath = Annotated[
    Path,
    typer.Argument(
        callback=_named_scene, help="scene file, or a name of `vbaa-bench scenes`: quickstart"
    ),
]
SceneOption = Annotated[
    Path | None,
    typer.Option(
        "--scene",
        callback=_named_scene,
        help="scene, for --repair",
        show_default="the dataset's own record",
    ),
]
DatasetPath = Annotated[
    Path, typer.Argument(callback=checked_path, help="dataset folder, from generate or run")
]
SceneOrDataset = Annotated[
    Path,
    typer.Argument(
        callback=_named_source,
        help="scene file, a name of `vbaa-bench scenes`, or folder of a dataset",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(callback=checked_path, help="folder to write", show_default="runs/SCENE"),
]
Seed = Annotated[int | None, typer.Option(min=0, help="seed in place of the scene's own")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="value in place of the scene's: beam.length_mm=200; repeatable"),
]
Modules = Annotated[
    list[str] | None,
    typer.Option(
        "--module",
        callback=_use_modules,
        expose_value=False,
        help="kinds of your own, in NAME.py (see docs/kinds.md); repeatable",
        metavar="NAME",
    ),
]
FrameCount = Annotated[
    int | None,
    typer.Option(
        "--frames", min=1, help="frames per rig: sets sampling.count or pushes.draws, rounded up"
    ),
]
Rigs = Annotated[
    str | None,
    typer.Option(help="rigs to make, as 7 or 3:7 (3 to 6)", show_default="all of the scene"),
]
Dask = Annotated[
    str | None,
    typer.Option(
        help="Dask workers that render: the scheduler's address, or a file (docs/long_runs.md)",
        show_default="processes of this machine",
    ),
]
PartOption = Annotated[
    str | None,
    typer.Option("--part", help="one of several parts, as 2/5, for several machines; then merge"),
]
Fork = Annotated[
    bool,
    typer.Option("--fork", help="if the folder holds something else, write beside it: OUT-2, ..."),
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, max=256, help="number of processes", show_default="one per core"),
]
Variant = Annotated[
    str | None,
    typer.Option(
        help="Mitsuba variant; llvm_native is for this very processor, with other last digits",
        show_default="llvm_ad_mono, else scalar_rgb",
    ),
]


def _known_methods(names: list[str] | None) -> list[str] | None:
    """Refuse a misspelled name before anything is made. Raises InputError."""
    for name in names or ():
        if ":" not in name and name not in (*METHODS, "all"):
            from solver.methods.by_name import check_known  # late: it imports all methods

            check_known([name], ", all, or package.module:function")
    return names


Method = Annotated[
    list[str] | None,
    typer.Option(
        callback=_known_methods,
        help=f"{', '.join(METHODS)}, all, or package.module:function; repeatable",
        show_default="all that the dataset has readings for",
    ),
]
Centreline = Annotated[
    list[str] | None,
    typer.Option(
        callback=_checked_centrelines,
        help=f"extraction of the centreline: {', '.join(CENTRELINES)}; repeatable",
        show_default=USUAL_CENTRELINE,
    ),
]
Repeats = Annotated[int, typer.Option(min=1, help="solutions per frame; the median time is used")]
Memory = Annotated[
    float,
    typer.Option(
        min=0, help="memory limit of a method and of each process it starts [GB]; 0: no limit"
    ),
]
Predictions = Annotated[
    list[Path] | None,
    typer.Option(help="your own CSV or Parquet with frame_id and x_c_mm or force_n; repeatable"),
]
By = Annotated[
    str | None,
    typer.Option(help=f"one row per value of this condition: {', '.join((*CONDITIONS, *STRATA))}"),
]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object only")]
