"""Commands that make datasets: generate, merge."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from solver.instrument.errors import InputError
from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import (
    AsJson,
    Dask,
    Fork,
    FrameCount,
    Modules,
    Out,
    PartOption,
    Rigs,
    ScenePath,
    Seed,
    Settings,
    Variant,
    Workers,
    part_of,
    rig_numbers,
)
from vbaa_bench.report.console import console, print_line, print_result

if TYPE_CHECKING:
    from vbaa_bench.dataset.collection import FrameCounts
    from vbaa_bench.scene.load import SceneFile


def generate(
    scene: ScenePath,
    out: Out = None,
    seed: Seed = None,
    settings: Settings = None,
    _module: Modules = None,
    frames: FrameCount = None,
    rigs: Rigs = None,
    part: PartOption = None,
    fork: Fork = False,
    dask: Dask = None,
    workers: Workers = None,
    variant: Variant = None,
    plan: Annotated[
        bool,
        typer.Option(
            "--plan", help="forecast time, disk space and memory from a few frames instead"
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Render a scene into a dataset. Run it again to finish an interrupted dataset.

    The exit status is 1 if frames or rigs failed; the others are complete.
    """
    choice = SceneChoice(scene, seed, settings, frames, rigs, part_of(part), fork, dask)
    if plan:
        _show_forecast(choice, workers, variant, as_json)
        return
    root, counts, digest = generate_dataset(choice, out, workers, variant)
    record = {"dataset": str(root), **counts._asdict(), "digest": digest}
    print_result(record, f"{counts.frames} frames in {root}\ndigest {digest}", as_json)
    exit_if_incomplete(counts)


def _show_forecast(
    choice: "SceneChoice", workers: int | None, variant: str | None, as_json: bool
) -> None:
    """Forecast the cost of a scene's dataset or collection, and print it."""
    if (choice.rigs, choice.part, choice.dask) != (None, None, None):
        raise InputError(
            "--plan forecasts the whole scene on this machine: --rigs, --part and --dask are not "
            "allowed"
        )
    with importing():
        from vbaa_bench.api.forecast import forecast
        from vbaa_bench.scene.load import load_scene

    file = load_scene(choice.path, choice.seed, choice.settings or (), choice.frames)
    say_what_is_drawn_once(file)
    with console.status("probing a few frames"):
        cost = forecast(file, workers=workers, variant=variant)
    print_result(cost.record(), str(cost), as_json)


def say_what_is_drawn_once(file: "SceneFile") -> None:
    """Name the random keys that have one value for all frames, which may not be meant."""
    if file.drawn_once:
        print_line(
            f"drawn once for all frames: {', '.join(file.drawn_once)}; with per: push or per: "
            "frame a key is drawn for every push or frame"
        )


def exit_if_incomplete(counts: "FrameCounts") -> None:
    """Exit with status 1 if frames or rigs failed, and say how many."""
    if not counts.complete:
        rigs = f" and {counts.failed_rigs} rigs" if counts.failed_rigs else ""
        console.print(
            f"{counts.failed_frames} frames{rigs} failed; the reasons are in "
            f"truth/shard_*/failures.json{' and rigs.csv' if rigs else ''}"
        )
        raise typer.Exit(1)


class GeneratedFolder(NamedTuple):
    """A dataset or collection, how many frames it has, and its digest."""

    root: Path
    counts: "FrameCounts"
    digest: str


class SceneChoice(NamedTuple):
    """A scene file, and what options change in it or select of it."""

    path: Path
    seed: int | None = None
    settings: list[str] | None = None
    frames: int | None = None
    rigs: str | None = None
    part: tuple[int, int] | None = None
    fork: bool = False
    dask: str | None = None


def merge(
    out: Annotated[Path, typer.Argument(help="new folder")],
    parts: Annotated[list[Path], typer.Argument(help="folders generated with --part")],
    _module: Modules = None,
    as_json: AsJson = False,
) -> None:
    """Merge the parts of a dataset or of a collection into a new folder."""
    with importing():
        from vbaa_bench.dataset.merge import merge as merge_parts

    merge_parts(parts, out)
    print_result({"dataset": str(out), "parts": len(parts)}, str(out), as_json)


def generate_dataset(
    choice: SceneChoice, out: Path | None, workers: int | None, variant: str | None
) -> GeneratedFolder:
    """Render a scene with progress bars; return the folder of the dataset or collection."""
    with importing():
        from vbaa_bench.api import data
        from vbaa_bench.dataset.collection import count_frames
        from vbaa_bench.dataset.overall_digest import dataset_digest
        from vbaa_bench.scene.load import load_scene

    file = load_scene(choice.path, choice.seed, choice.settings or (), choice.frames)
    root = out or Path("runs") / choice.path.stem
    if choice.rigs is not None and file.rigs is None:
        raise InputError(f"--rigs is {choice.rigs}, but {choice.path} states no rigs")
    try:
        if file.rigs is None:
            made = data.generate(
                file,
                root,
                workers=workers,
                variant=variant,
                part=choice.part,
                fork=choice.fork,
                dask=choice.dask,
                progress=True,
            ).root
        else:
            numbers = rig_numbers(choice.rigs, file.rigs)
            if choice.part is not None:
                numbers = numbers[choice.part[0] - 1 :: choice.part[1]]
            made = data.generate_rigs(
                file,
                root,
                rigs=numbers,
                workers=workers,
                variant=variant,
                fork=choice.fork,
                dask=choice.dask,
                progress=True,
            ).root
    except KeyboardInterrupt:
        console.print("interrupted; run the same command again to continue")
        raise
    return GeneratedFolder(Path(made), count_frames(Path(made)), dataset_digest(Path(made)))
