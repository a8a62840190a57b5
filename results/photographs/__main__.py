"""Photographs of beams with hung weights, solved and scored:  python -m results.photographs"""

from pathlib import Path
from typing import Annotated

import typer

from results.photographs.draw import draw_rig
from results.photographs.folder import write_rig
from results.photographs.measure import compare, solve
from results.photographs.page import HEADS, lines, markdown, picture, records
from solver.lab.command_end import run_command
from solver.lab.writing import prepare_output_path, write
from vbaa_bench.cli.options import AsJson, Variant
from vbaa_bench.render.variant import activate, choose
from vbaa_bench.report.console import print_result, progress_bars, show_table

app = typer.Typer()


@app.command()
def check_photographs(
    rigs: Annotated[int, typer.Option(min=1, help="drawn rigs, of 8 to 10 photographs each")] = 12,
    seed: Annotated[int, typer.Option(min=0, help="seed of the draws")] = 1,
    work: Annotated[Path, typer.Option(help="folder for photographs, truth and estimates")] = Path(
        "runs/photographs"
    ),
    out: Annotated[Path | None, typer.Option(help="folder for README.md and a picture")] = None,
    variant: Variant = None,
    as_json: AsJson = False,
) -> None:
    """Photograph beams with hung weights as with a phone, solve the photographs and score them.

    What WORK has already is not done again; each seed has a folder of its own in it.
    """
    if out:
        prepare_output_path(out / "README.md")
    folder = work / f"seed_{seed}"
    activate(choose(variant), 0, colour=True)
    with progress_bars() as bars:
        total = sum(len(draw_rig(seed, number).photos) for number in range(rigs))
        taking = bars.add_task("photographs", total=total)
        solving = bars.add_task("rigs solved", total=rigs)
        for number in range(rigs):
            write_rig(seed, number, folder, lambda: bars.advance(taking))
            solve(number, folder)
            bars.advance(solving)
    solved = [one for number in range(rigs) for one in compare(number, folder)]
    scored = records(solved)
    if out:
        command = (
            f"python -m results.photographs --rigs {rigs} --seed {seed} --out results/photographs"
        )
        write(out / "photographs.jpg", picture(folder, rigs))
        write(out / "README.md", markdown(scored, solved, command, "photographs.jpg").encode())
    if as_json:
        print_result({"parts": scored, "photos": [one._asdict() for one in solved]}, "", True)
    else:
        show_table("photographs", HEADS, lines(scored))


if __name__ == "__main__":
    run_command(app)
