"""Commands that measure methods: their errors under disturbances, and the causes."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import TaskID

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import METHODS, AsJson, Modules, ScenePath, Variant, Workers
from vbaa_bench.report.console import console, print_result, progress_bar, progress_bars, show_table


def stress(
    scene: ScenePath,
    rigs: Annotated[int, typer.Option(min=1, max=10_000, help="number of random rigs")] = 30,
    frames: Annotated[int, typer.Option(min=1, max=10_000, help="frames per rig")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="seed of the random rigs")] = 1,
    row: Annotated[
        list[str] | None, typer.Option(help="row of the table; repeatable", show_default="all")
    ] = None,
    method: Annotated[str, typer.Option(help=", ".join(METHODS))] = "exact_fit",
    work: Annotated[
        Path | None,
        typer.Option(help="folder for the rigs' datasets", show_default="runs/stress/SCENE"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="JSON file to write, with the result of every frame")
    ] = None,
    _module: Modules = None,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Measure errors under disturbances of ordinary cameras and laboratories, on random rigs.

    The exit status is 1 if a target is missed. Rendered rigs are stored and reused.
    """
    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.benchmarks.stress import command
        from vbaa_bench.benchmarks.stress.table import HEADS, TITLE, lines
        from vbaa_bench.render.variant import choose
        from vbaa_bench.scene.load import load_scene
        from vbaa_bench.workers.resources import cores

    if out:
        prepare_output_path(out, (scene,))
    plan = command.Plan(load_scene(scene), rigs, frames, seed, row or (), method)
    folder = work or Path("runs/stress") / scene.stem
    count = workers or cores()
    with progress_bars() as progress:
        bars = {name: progress_bar(progress, name) for name in ("rendering", "solving")}
        try:
            record = command.stress(
                plan,
                folder,
                choose(variant),
                count,
                lambda name, done, total: bars[name](done, total),
            )
        except KeyboardInterrupt:
            console.print("interrupted; the same command reuses the rendered rigs")
            raise
    if out:
        write(out, command.text(record).encode())
    if as_json:
        print_result(command.without_frames(record), "", True)
    else:
        title = f"{record['scene']}: {rigs} rigs x {frames} frames\n{TITLE}"
        show_table(title, HEADS, lines(record["rows"]))
    if not record["holds"]:
        raise typer.Exit(1)


def budget(
    datasets: Annotated[list[Path], typer.Argument(help="folders of datasets")],
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method", "-m", help=f"{', '.join(METHODS)}; repeatable", show_default="exact_fit"
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="CSV file to write")] = None,
    _module: Modules = None,
    as_json: AsJson = False,
) -> None:
    """Split the errors of methods into causes: centreline, rest pose, calibration, beam model.

    One stage after the other is replaced by the truth. `report` shows the result as bars.
    """
    with importing():
        import polars as pl

        from solver.lab.writing import prepare_output_path, write
        from solver.methods.by_name import check_known
        from vbaa_bench.benchmarks.budget import command

    methods = method or ["exact_fit"]
    check_known(methods)
    if out:
        prepare_output_path(out)
    rows = []
    with progress_bars() as progress:
        for dataset in datasets:
            task = progress.add_task(dataset.name, total=None)

            def on_frame(frames: int, task: TaskID = task) -> None:
                progress.update(task, total=len(methods) * frames, advance=1)

            record = command.budget(dataset, methods, on_frame=on_frame)
            rows += command.rows(dataset.name, record)
    if out:
        write(out, pl.DataFrame(rows, infer_schema_length=None).write_csv().encode())
    if as_json:
        print_result({"rows": rows}, "", True)
    else:
        show_table("error of x_c by cause", command.HEADS, map(command.cells, rows))
