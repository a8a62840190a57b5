"""Pictures of the README:  python -m results.pictures scenes"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Final

import typer

from results.pictures.contact_sheet import contact_sheet
from results.pictures.example_rig import example_rig
from results.pictures.lighting_sheet import lighting_sheet
from results.pictures.outside_view import outside_view
from solver.instrument.errors import InputError
from solver.lab.command_end import run_command
from solver.lab.example import EXAMPLE
from solver.lab.writing import prepare_output_path
from vbaa_bench.cli.options import ScenePath, Variant
from vbaa_bench.render.variant import choose
from vbaa_bench.report.console import console, progress_bars
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scene.shipped import SUITES

HERE: Final = Path(__file__).parent
# Renders scenes into one picture; the last argument is called with the number done and the total.
Sheet = Callable[[Sequence[Path], Path, str, Callable[[int, int], None]], object]

app = typer.Typer()


Folder = Annotated[Path, typer.Argument(help="folder of scenes")]
Picture = Annotated[Path | None, typer.Option(help="PNG file to write", show_default="in results/")]


@app.command()
def scenes(folder: Folder = Path("scenes"), out: Picture = None, variant: Variant = None) -> None:
    """Render one frame of every scene of a folder into one picture, look-alikes once."""
    _draw(contact_sheet, folder, out or HERE / "scenes.png", variant)


@app.command()
def lights(
    folder: Folder = Path("scenes/lighting"), out: Picture = None, variant: Variant = None
) -> None:
    """Render the same push under every light of a folder, with every material and ground."""
    _draw(lighting_sheet, folder, out or HERE / "lighting.png", variant)


def _draw(sheet: Sheet, folder: Path, out: Path, variant: str | None) -> None:
    paths = [path for path in sorted(folder.rglob("*.yaml")) if path.parent.name != SUITES]
    if not paths:
        raise InputError(f"{folder}: holds no scene (*.yaml)")
    with progress_bars() as progress:
        task = progress.add_task("scenes", total=len(paths))
        sheet(paths, out, choose(variant), lambda n, _: progress.update(task, completed=n))
    print(out)


@app.command()
def outside(
    scene: ScenePath,
    frame: Annotated[
        int, typer.Option(min=0, help="frame number, in the order of the scene's pushes")
    ] = 0,
    out: Picture = None,
    variant: Variant = None,
) -> None:
    """Render the whole rig of a scene from outside, in colour."""
    file, out = load_scene(scene), out or HERE / "outside_view.png"
    prepare_output_path(out)
    with console.status("rendering the rig"):
        outside_view(file, frame, out, choose(variant))
    print(out)


@app.command()
def example(
    work: Annotated[Path, typer.Argument(help="folder for the dataset, which is kept")],
    scene: ScenePath = HERE / "example_rig.yaml",
    out: Annotated[Path, typer.Option(help="new folder")] = EXAMPLE,
    truth: Annotated[Path, typer.Option(help="JSON to write")] = Path(
        "tests/data/example_rig.json"
    ),
    variant: Variant = None,
) -> None:
    """Render the example rig of the antenna's software, and keep its truth apart."""
    example_rig(scene, work, out, truth, choose(variant))
    print(out)


if __name__ == "__main__":
    run_command(app)
