"""Speed against error of rendering:  python -m results.render_speed SCENE"""

from pathlib import Path
from typing import Annotated

import typer

from results.render_speed import curves
from results.render_speed.measure import measure
from solver.lab.command_end import run_command
from vbaa_bench.cli.options import AsJson, ScenePath, Variant
from vbaa_bench.render.variant import choose
from vbaa_bench.report.console import console, print_result
from vbaa_bench.scene.load import load_scene

app = typer.Typer()


@app.command()
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
    # Not in the scene's dataset folder, which must be empty when `generate` starts.
    root = out or Path("runs") / f"{scene.stem}_speed"
    with console.status("rendering frames"):
        record = measure(load_scene(scene), choose(variant), seconds, root)
    print_result(record, curves.sentence(record, root), as_json)


if __name__ == "__main__":
    run_command(app)
