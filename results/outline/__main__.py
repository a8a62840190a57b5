"""Outlines of objects, from pushes all around them:  python -m results.outline SCENES"""

from pathlib import Path
from typing import Annotated

import typer

from results.outline.measure import measure
from results.outline.page import HEADS, lines, markdown
from results.outline.picture import png
from results.outline.true_outline import TrueOutline
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.data import SceneChoice, generate_dataset
from vbaa_bench.cli.options import MEMORY_GB, AsJson, Seed, Variant, Workers
from vbaa_bench.cli.results import solve_dataset
from vbaa_bench.report.console import print_result, show_table
from vbaa_bench.scene.load import load_scene

app = typer.Typer()


@app.command()
def outline(
    scenes: Annotated[list[Path], typer.Argument(help="scene files with a carriage")],
    method: Annotated[str, typer.Option(help="method of the solver")] = "exact_fit",
    seed: Seed = None,
    work: Annotated[Path, typer.Option(help="folder for the datasets")] = Path("runs/outline"),
    out: Annotated[Path | None, typer.Option(help="folder for README.md and the pictures")] = None,
    workers: Workers = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Reconstruct the outlines of objects from pushes all around them, and score them.

    Datasets that exist are reused.
    """
    if out:
        prepare_output_path(out / "README.md")
    files = [load_scene(path, seed, ()) for path in scenes]
    # Before anything is rendered: a scene may have no outline.
    true_outlines = [TrueOutline(file) for file in files]
    records = {}
    for path, file, true_outline in zip(scenes, files, true_outlines, strict=True):
        name = path.stem if seed is None else f"{path.stem}_{seed}"
        root = generate_dataset(SceneChoice(path, seed, None), work / name, workers, variant).root
        solve_dataset(root, [method], None, 1, MEMORY_GB)
        records[name], reconstruction = measure(true_outline, root, method)
        if out:
            write(out / f"{name}.png", png(reconstruction, file.scene.title))
    if out:
        options = "" if seed is None else f" --seed {seed}"
        command = (
            f"python -m results.outline {' '.join(map(str, scenes))}{options} --out results/outline"
        )
        write(out / "README.md", markdown(records, command).encode())
    if as_json:
        print_result({"scenes": records}, "", True)
    else:
        show_table("outlines", HEADS, lines(records))


if __name__ == "__main__":
    run_command(app)
