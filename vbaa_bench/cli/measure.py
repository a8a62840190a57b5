"""Commands that measure the methods and this machine: stability, stress, doctor."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from vbaa_bench.cli.interrupt import importing
from vbaa_bench.cli.options import METHODS, AsJson, ScenePath, Variant, Workers
from vbaa_bench.report.console import console, progress_bars, say, show_table


def stability(as_json: AsJson = False) -> None:
    """Measure each method's noise amplification, rounding sensitivity and condition number."""
    with importing():
        from vbaa_bench.benchmarks import stability as methods

    with console.status("perturbing points"):
        record = methods.measure()
    if as_json:
        say(record, "", True)
        return
    contacts = sorted({case["contact"] for case in record["methods"]["exact_fit"]})
    places = ", ".join(f"{contact:g}" for contact in contacts)
    show_table(
        f"per pixel of noise, for contacts at x_c / L = {places}; condition; rounding",
        ("method", "deflection", "x_c, % of L", "force, %", "condition", "x_c / L by 1 ulp"),
        methods.rows(record),
    )


def stress(
    scene: ScenePath,
    rigs: Annotated[int, typer.Option(min=1, max=10_000, help="drawn rigs")] = 30,
    frames: Annotated[int, typer.Option(min=1, max=10_000, help="frames of each rig")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="draws other rigs")] = 1,
    row: Annotated[
        list[str] | None, typer.Option(help="a row of the table; repeatable", show_default="all")
    ] = None,
    method: Annotated[str, typer.Option(help=", ".join(METHODS))] = "exact_fit",
    work: Annotated[
        Path | None,
        typer.Option(help="folder of the rigs' datasets", show_default="runs/stress/<scene>"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="JSON to write, with the result of every frame")
    ] = None,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Perturb the images of drawn rigs as ordinary cameras and laboratories do, and solve them.

    Exit status 1 if a wanted figure is not reached. Rendered rigs are kept and used again.
    """
    with importing():
        from solver.lab.writing import make_room, write
        from vbaa_bench.benchmarks.stress import command
        from vbaa_bench.benchmarks.stress.run import HEADS, TITLE, lines
        from vbaa_bench.generation.workers import cores
        from vbaa_bench.render.variant import choose
        from vbaa_bench.scene.load import load_scene

    if out:
        make_room(out)
    plan = command.Plan(load_scene(scene), rigs, frames, seed, row or (), method)
    folder = work or Path("runs/stress") / scene.stem
    count = workers or cores()
    with progress_bars() as progress:
        bars = {name: progress.add_task(name, total=None) for name in ("rendering", "solving")}
        try:
            record = command.stress(
                plan,
                folder,
                choose(variant),
                count,
                lambda name, done, total: progress.update(bars[name], completed=done, total=total),
            )
        except KeyboardInterrupt:
            console.print("interrupted; the same command uses the rigs that are rendered")
            raise
    if out:
        write(out, command.text(record).encode())
    if as_json:
        say(command.without_frames(record), "", True)
    else:
        title = f"{record['scene']}: {rigs} rigs x {frames} frames\n{TITLE}"
        show_table(title, HEADS, lines(record["rows"]))
    if not record["holds"]:
        raise typer.Exit(1)


def doctor(
    install: Annotated[
        bool, typer.Option("--install", help="install missing libraries by apt, as root")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="one line")] = False,
    as_json: AsJson = False,
) -> None:
    """Say what this machine can render with, and what to install."""
    # Import nothing that needs the renderer's libraries: this command must run without them.
    with importing():
        from vbaa_bench.cli import doctor as checks

    if install:
        console.print(checks.install_libraries())
        if quiet:
            return
    found = checks.diagnose()
    shown = Table("variant", "works", "said")
    for probe in found.probes:
        shown.add_row(probe.variant, "yes" if probe.works else "no", probe.said)
    if as_json:
        say(found.record(), "", True)
    else:
        if not quiet:
            Console().print(shown)
        console.print(found.advice)
    if not found.healthy:
        raise typer.Exit(1)
