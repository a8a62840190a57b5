"""The commands `vbaa-bench speed`: mechanics, render, scenes, solve, scores."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import AsJson, DatasetPath, Repeats, ScenePath, Variant
from vbaa_bench.report.console import console, print_result, progress_bars, show_table

speed_app = typer.Typer(no_args_is_help=True, help="Measure speed and error.")


@speed_app.command()
def mechanics(
    yardstick_seconds: Annotated[
        float, typer.Option(min=1, help="seconds for PyElastica to reach equilibrium")
    ] = 60,
    as_json: AsJson = False,
) -> None:
    """Measure equilibria per second on one core and their error; PyElastica too, if installed."""
    with importing():
        from vbaa_bench.benchmarks import speed_mechanics

    with console.status("measuring on one core"):
        record = speed_mechanics.measure_apart(yardstick_seconds)
    if as_json:
        print_result(record, "", True)
        return
    table = Table(title="one core; ratio to PyElastica; maximum error", title_justify="left")
    for head in ("model", "states/s", "ratio", "error"):
        first = head == "model"
        table.add_column(head, justify="left" if first else "right", no_wrap=True)
    table.add_column("remark", overflow="fold")
    for row in speed_mechanics.rows(record):
        table.add_row(*map(escape, row))
    Console().print(table)


@speed_app.command()
def render(
    scene: ScenePath,
    out: Annotated[
        Path | None, typer.Option(help="folder to write", show_default="runs/<scene>_speed")
    ] = None,
    seconds: Annotated[float, typer.Option(min=1, help="approximate duration, in seconds")] = 120,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Measure time per frame and image error, and compare them with plain Mitsuba."""
    with importing():
        from vbaa_bench.benchmarks import speed_curves, speed_render
        from vbaa_bench.render.variant import choose
        from vbaa_bench.scene.load import load_scene

    # Not in the scene's dataset folder, which must be empty when `generate` starts.
    root = out or Path("runs") / f"{scene.stem}_speed"
    with console.status("rendering frames"):
        record = speed_render.measure(load_scene(scene), choose(variant), seconds, root)
    print_result(record, speed_curves.sentence(record, root), as_json)


@speed_app.command()
def scenes(
    folder: Annotated[Path, typer.Argument(help="folder of scenes")] = Path("scenes"),
    out: Annotated[
        Path, typer.Option(help="folder to write; delete it to measure all scenes again")
    ] = Path("runs/scene_speed"),
    limit: Annotated[float, typer.Option(min=1, help="time limit of a scene, in seconds")] = 120,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Measure what every scene of a folder costs on one core, part by part.

    Run it again to finish an interrupted table; scenes that have not changed are not measured
    again.
    """
    with importing():
        from solver.instrument.errors import InputError
        from vbaa_bench.benchmarks import scene_table, speed_scenes
        from vbaa_bench.render.variant import choose

    paths = sorted(folder.rglob("*.yaml"))
    if not paths:
        raise InputError(f"{folder}: holds no scene (*.yaml)")
    named = {path.relative_to(folder).with_suffix("").as_posix(): path for path in paths}
    with progress_bars() as progress:
        task = progress.add_task("scenes", total=None)
        try:
            speeds = speed_scenes.measure(
                named,
                out,
                choose(variant),
                limit,
                lambda done, total: progress.update(task, completed=done, total=total),
            )
        except KeyboardInterrupt:
            console.print("interrupted; run the same command again to continue")
            raise
    if as_json:
        rows = [speed.record() for speed in speeds]
        print_result({**scene_table.summary(speeds), "rows": rows}, "", True)
        return
    show_table("seconds on one core", *scene_table.cells(speeds))
    reasons = [f"{speed.scene}: {speed.reason}" for speed in speeds if speed.reason is not None]
    lines = [*reasons, f"{scene_table.sentence(speeds)}; {out / 'scene_speed.md'}"]
    print_result({}, "\n".join(lines), False)


QUICKSTART = Path("scenes/quickstart.yaml")


@speed_app.command()
def solve(
    dataset: Annotated[
        Path | None,
        typer.Argument(help="dataset folder", show_default=f"rendered from {QUICKSTART}"),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(help="method of the solver; repeatable", show_default="all"),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=1, help="maximum number of frames; pushes are not split")
    ] = 120,
    repeats: Repeats = 3,
    first_ever: Annotated[
        bool, typer.Option(help="also measure a first start, which compiles for over a minute")
    ] = True,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Measure the time of each method, from an image in memory and from points, and its error."""
    with importing():
        from vbaa_bench.benchmarks import speed_solve
        from vbaa_bench.dataset.layout import Layout
        from vbaa_bench.dataset.readers import open_truth
        from vbaa_bench.scoring.speed import judged

    layout = Layout(dataset or _quickstart(variant))
    truth = open_truth(layout.truth)
    with console.status("measuring on one core"):
        measured = speed_solve.measure_apart(
            layout.observations, method, frames, repeats, first_ever=first_ever
        )
    record = {"dataset": str(layout.root), **judged(truth, measured)}
    if as_json:
        print_result(record, "", True)
    else:
        show_speeds(record)


@speed_app.command()
def scores(
    dataset: DatasetPath,
    frames: Annotated[int, typer.Option(min=1, help="number of frames")] = 100_000,
    method: Annotated[
        list[str] | None, typer.Option(help="solved method; repeatable", show_default="all")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure scoring and reporting of many frames, which are copies of a solved dataset's."""
    with importing():
        from vbaa_bench.benchmarks import speed_scores

    with console.status("measuring"):
        record = speed_scores.measure(dataset, frames, method or ())
    if as_json:
        print_result(record, "", True)
        return
    rows = [
        (stage, *(f"{value:.3g}" for value in record[stage].values()))
        for stage in speed_scores.STAGES
    ]
    title = f"{record['frames']:,} frames, {len(record['methods'])} methods"
    show_table(title, ("stage", "seconds", "processor time, s", "peak memory, GB"), rows)


@speed_app.command()
def loading(
    datasets: Annotated[list[Path], typer.Argument(help="dataset folders")],
    out: Annotated[Path, typer.Option(help="Markdown file to write")] = Path(
        "results/production/torch.md"
    ),
    as_json: AsJson = False,
) -> None:
    """Measure images per second for training with PyTorch, and check every image."""
    with importing():
        from solver.lab.writing import prepare_output_path, write
        from vbaa_bench.benchmarks import speed_loading

    prepare_output_path(out)
    with console.status("measuring"):
        measured = [speed_loading.measure(dataset) for dataset in datasets]
    names = " ".join(str(dataset) for dataset in datasets)
    text = speed_loading.page(measured, f"vbaa-bench speed loading {names}")
    write(out, text.encode())
    print_result({"page": str(out), "datasets": measured}, f"{text}\n{out}", as_json)


def show_speeds(record: dict[str, Any]) -> None:
    """Print the table of `vbaa-bench speed solve`."""
    width, height = record["image_px"]
    title = (
        f"{record['frames']} frames of {width} x {height} px, one core; not included: "
        f"decoding {record['decode_ms_per_frame']:.2g} ms per frame, "
        f"calibration {record['set_up_s']:.2g} s"
    )
    heads = ("method", "ms/image", "us/points", "us batched", "x_c, % of L", "force, %", "start, s")
    rows = []
    for name, values in record["methods"].items():
        numbers = (
            values["image_ms_per_frame"],
            values["points_us_per_frame"],
            values["points_us_per_frame_batched"],
            values["x_c_rmse_pct_L"],
            values["force_rmse_pct"],
            values["cold_start"]["total_s"],
            (values["first_start"] or {}).get("total_s"),
        )
        cells = ("–" if number is None else f"{float(f'{number:.3g}'):,g}" for number in numbers)
        rows.append((name, *cells))
    show_table(title, (*heads, "first ever, s"), rows)
    Console().print(
        "Errors are RMSEs over frames with an estimate. A start lasts from the command to the "
        "first estimate; the first start ever includes compilation, whose result is cached."
    )
    for name, values in record["methods"].items():
        if set(values["outcomes"]) != {"contact"}:
            counts = ", ".join(
                f"{count} {outcome}" for outcome, count in values["outcomes"].items()
            )
            Console(soft_wrap=True).print(f"{name}: {counts}", highlight=False, markup=False)


def _quickstart(variant: str | None) -> Path:
    with importing():
        from vbaa_bench.api.data import generate

    root = Path("runs") / QUICKSTART.stem
    with console.status(f"rendering {QUICKSTART}"):
        generate(QUICKSTART, root, variant=variant)
    return root
