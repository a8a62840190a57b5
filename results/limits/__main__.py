"""Information limits beside re-rendered images:  python -m results.limits SCENES"""

from pathlib import Path
from typing import Annotated

import typer

from results.limits import agreement, page, trials
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.options import AsJson, Variant
from vbaa_bench.render.variant import choose
from vbaa_bench.report.console import print_result, progress_bars, show_table

app = typer.Typer()


@app.command()
def check_limits(
    scenes: Annotated[list[Path], typer.Argument(help="scene files")],
    frames: Annotated[int, typer.Option(min=1, help="frames per scene")] = 3,
    exposures: Annotated[
        int, typer.Option(min=100, help="noisy exposures of the first frame of each scene")
    ] = 2000,
    out: Annotated[Path | None, typer.Option(help="Markdown file to write")] = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Compare information limits with those of re-rendered images, and with noisy exposures."""
    if out:
        prepare_output_path(out)
    with progress_bars() as progress:
        task = progress.add_task("rendering", total=frames * len(scenes))
        record = page.measure(
            scenes, choose(variant), frames, exposures, lambda: progress.advance(task)
        )
    if out:
        counts = f"--frames {frames} --exposures {exposures} --out {out.name}"
        command = f"python -m results.limits {' '.join(map(str, scenes))} {counts}"
        write(out, page.markdown(record, command).encode())
    if as_json:
        print_result(record, "", True)
        return
    show_table(
        "ratios of standard deviations",
        agreement.HEADS,
        agreement.lines(record["agreement"]),
    )
    show_table("noisy exposures", trials.HEADS, trials.lines(record["trials"]))


if __name__ == "__main__":
    run_command(app)
