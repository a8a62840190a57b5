"""Speed of loading for training:  python -m results.loading_speed DATASETS"""

from pathlib import Path
from typing import Annotated

import typer

from results.loading_speed import measure as speed_loading
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.options import AsJson
from vbaa_bench.report.console import console, print_result

app = typer.Typer()


@app.command()
def loading(
    datasets: Annotated[list[Path], typer.Argument(help="dataset folders")],
    out: Annotated[Path, typer.Option(help="Markdown file to write")] = Path(
        "results/loading_speed/README.md"
    ),
    as_json: AsJson = False,
) -> None:
    """Measure images per second for training with PyTorch, and check every image."""
    prepare_output_path(out)
    with console.status("measuring"):
        measured = [speed_loading.measure(dataset) for dataset in datasets]
    names = " ".join(str(dataset) for dataset in datasets)
    text = speed_loading.page(measured, f"python -m results.loading_speed {names}")
    write(out, text.encode())
    print_result({"page": str(out), "datasets": measured}, f"{text}\n{out}", as_json)


if __name__ == "__main__":
    run_command(app)
