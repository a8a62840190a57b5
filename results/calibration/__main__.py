"""The calibrated camera beside the true one:  python -m results.calibration SCENE"""

import typer
from rich.console import Console
from rich.table import Table

from results.calibration import check_camera as camera
from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson, ScenePath, Variant
from vbaa_bench.render.variant import choose
from vbaa_bench.report.console import print_result, progress_bars
from vbaa_bench.scene.load import load_scene

app = typer.Typer()


@app.command()
def check_camera(scene: ScenePath, variant: Variant = None, as_json: AsJson = False) -> None:
    """Calibrate a scene's camera from rendered images, and compare it with the true camera."""
    file, chosen_variant = load_scene(scene), choose(variant)
    with progress_bars() as progress:
        task = progress.add_task("calibration images", total=None)
        checks, calibration = camera.check_camera(
            file,
            chosen_variant,
            lambda done, total: progress.update(task, completed=done, total=total),
        )
    record = camera.record(checks, calibration)
    if as_json:
        print_result(record, "", True)
    else:
        table = Table("quantity", "error", "allowed", "passes")
        for check in checks:
            row = f"{check.error:.3g} {check.unit}", f"{check.allowed:g} {check.unit}"
            table.add_row(check.quantity, *row, "yes" if check.passed else "no")
        Console().print(table)
    if not record["passed"]:
        raise typer.Exit(1)


if __name__ == "__main__":
    run_command(app)
