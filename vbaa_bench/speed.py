"""`vbaa-bench speed`: mechanics, render."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from vbaa_bench.console import console, say
from vbaa_bench.options import AsJson, Out, ScenePath, Variant
from vbaa_bench.render.variant import choose
from vbaa_bench.spec.load import load_scene

speed_app = typer.Typer(no_args_is_help=True, help="Measure speed beside error.")


@speed_app.command()
def mechanics(
    yardstick_seconds: Annotated[
        float, typer.Option(min=1, help="wall time PyElastica may take to come to rest")
    ] = 60,
    as_json: AsJson = False,
) -> None:
    """Beams per second on one core, and how far they err; PyElastica beside them, if installed."""
    # Imported late: no other command needs the mechanics' compiler here.
    from vbaa_bench.checks import speed_mechanics

    with console.status("measuring on one core"):
        record = speed_mechanics.measure_apart(yardstick_seconds)
    if as_json:
        say(record, "", True)
        return
    table = Table(title="one core; ratio to the yardstick; worst error", title_justify="left")
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
    out: Out = None,
    seconds: Annotated[float, typer.Option(min=1, help="about how long to measure")] = 120,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Seconds per frame against the error of its image, beside plain Mitsuba's."""
    # Imported late: doctor must run where the renderer cannot even be loaded.
    from vbaa_bench.checks import speed_curves, speed_render

    root = out or Path("runs") / scene.stem
    with console.status("rendering frames"):
        record = speed_render.measure(load_scene(scene), choose(variant), seconds, root)
    say(record, speed_curves.sentence(record, root), as_json)
