"""Arguments and options that commands share."""

from pathlib import Path
from typing import Annotated

import typer

from solver.methods import METHODS

ScenePath = Annotated[Path, typer.Argument(help="a scene, such as scenes/quickstart.yaml")]
DatasetPath = Annotated[Path, typer.Argument(help="a folder made by generate or run")]
Out = Annotated[Path | None, typer.Option(help="folder to write [default: runs/<scene>]")]
Seed = Annotated[int | None, typer.Option(min=0, help="replaces the scene's seed")]
Workers = Annotated[
    int | None, typer.Option(min=1, max=256, help="processes [default: one a core]")
]
Variant = Annotated[
    str | None, typer.Option(help="Mitsuba variant [default: llvm_ad_mono, else scalar_rgb]")
]
Method = Annotated[
    list[str] | None,
    typer.Option(
        help=f"{', '.join(METHODS)}, all, or package.module:function; repeatable "
        "[default: those that the dataset has readings for]"
    ),
]
Repeats = Annotated[int, typer.Option(min=1, help="times each frame is solved; median time counts")]
Predictions = Annotated[
    list[Path] | None,
    typer.Option(help="CSV or Parquet with frame_id and x_c_mm or force_n; repeatable"),
]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object, nothing else")]
