"""Commands on existing datasets: verify, info, subset, merge."""

from pathlib import Path
from typing import Annotated

import typer

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import METHODS, AsJson, DatasetPath, Workers
from vbaa_bench.report.console import print_result, progress_bars


def verify(
    dataset: DatasetPath,
    repair: Annotated[
        bool, typer.Option("--repair", help="render damaged files again, remove surplus files")
    ] = False,
    scene: Annotated[
        Path | None,
        typer.Option(help="scene file, for --repair", show_default="the dataset's own record"),
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
                bars.console.print(sentence, markup=False, soft_wrap=True)

        rendering = bars.add_task("rendering", total=None, visible=False)

        def on_frame(done: int, total: int) -> None:
            bars.update(rendering, completed=done, total=total, visible=True)

        result = verify_dataset(
            dataset,
            METHODS,
            repair=repair,
            scene=file,
            workers=workers,
            on_shard=on_shard,
            on_fault=on_fault,
            on_frame=on_frame,
        )
    print_result(result.record(), str(result), as_json)
    if result.faults:
        raise typer.Exit(1)
