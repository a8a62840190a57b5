"""What every scene costs:  python -m results.scene_speed"""

from pathlib import Path
from typing import Annotated

import typer

from results.scene_speed import table
from results.scene_speed.measure import measure
from solver.instrument.errors import InputError
from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson, Variant
from vbaa_bench.render.variant import choose
from vbaa_bench.report.console import console, print_result, progress_bars, show_table
from vbaa_bench.scene.shipped import SUITES

app = typer.Typer()


@app.command()
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
    paths = [path for path in sorted(folder.rglob("*.yaml")) if path.parent.name != SUITES]
    if not paths:
        raise InputError(f"{folder}: holds no scene (*.yaml)")
    named = {path.relative_to(folder).with_suffix("").as_posix(): path for path in paths}
    with progress_bars() as progress:
        task = progress.add_task("scenes", total=None)
        try:
            speeds = measure(
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
        print_result({**table.summary(speeds), "rows": rows}, "", True)
        return
    show_table("seconds on one core", *table.cells(speeds))
    reasons = [f"{speed.scene}: {speed.reason}" for speed in speeds if speed.reason is not None]
    lines = [*reasons, f"{table.sentence(speeds)}; {out / 'scene_speed.md'}"]
    print_result({}, "\n".join(lines), False)


if __name__ == "__main__":
    run_command(app)
