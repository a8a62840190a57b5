"""Commands on existing datasets: verify, info, subset."""

from pathlib import Path
from typing import Annotated

import typer

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import METHODS, AsJson, DatasetPath, Workers
from vbaa_bench.report.console import console, print_line, print_result, progress_bars


def verify(
    dataset: DatasetPath,
    repair: Annotated[
        bool, typer.Option("--repair", help="render damaged files again, remove surplus files")
    ] = False,
    scene: Annotated[
        Path | None,
        typer.Option(help="scene file, for --repair", show_default="the dataset's own record"),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(help="digest that the dataset must have, which generate has printed"),
    ] = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Name everything that is wrong in a dataset or collection, in one pass.

    The exit status is 1 if anything is wrong. Damaged results must be computed again: the command
    is printed.
    """
    with importing():
        from vbaa_bench.api.verification import verify as verify_dataset
        from vbaa_bench.scene.load import load_scene

    file = None if scene is None else load_scene(scene)
    with progress_bars() as bars:
        task = bars.add_task("verifying", total=None)

        def on_shard(done: int, total: int) -> None:
            bars.update(task, completed=done, total=total)

        def on_fault(sentence: str) -> None:
            if not as_json:
                print_line(sentence)

        rendering = bars.add_task("rendering", total=None, visible=False)

        def on_frame(done: int, total: int) -> None:
            bars.update(rendering, completed=done, total=total, visible=True)

        result = verify_dataset(
            dataset,
            METHODS,
            repair=repair,
            scene=file,
            against=against,
            workers=workers,
            on_shard=on_shard,
            on_fault=on_fault,
            on_frame=on_frame,
        )
    print_result(result.record(), str(result), as_json)
    if result.faults:
        raise typer.Exit(1)


def info(dataset: DatasetPath, as_json: AsJson = False) -> None:
    """Print the facts on a dataset or collection: frames, failures, splits, versions, results."""
    with importing():
        from vbaa_bench.dataset.info import info_of

    facts = info_of(dataset)
    lines = list(facts.lines())
    width = max(len(name) for name, _ in lines)
    text = "\n".join(f"{name:{width}}  {value}" for name, value in lines)
    print_result(facts.record(), text, as_json)


def subset(
    dataset: DatasetPath,
    out: Annotated[Path, typer.Argument(help="new folder")],
    frames: Annotated[
        int | None, typer.Option(min=1, help="largest number of frames, of whole pushes")
    ] = None,
    split: Annotated[str | None, typer.Option(help="name of a split")] = None,
    shards: Annotated[
        str | None, typer.Option(help="shards, as 7 or 0:10 (0 to 9); pushes may be cut")
    ] = None,
    cut_pushes: Annotated[
        bool, typer.Option("--cut-pushes", help="with --frames: exactly this number of frames")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Copy some frames of a dataset into a new dataset, which is solved and scored as any other."""
    with importing():
        from vbaa_bench.dataset.subset import Choice, choice_of
        from vbaa_bench.dataset.subset import subset as write_subset

    choice: Choice = choice_of(frames, split, shards, cut_pushes)
    with console.status("copying"):
        count = write_subset(dataset, out, choice)
    print_result({"dataset": str(out), "frames": count}, f"{count} frames in {out}", as_json)
