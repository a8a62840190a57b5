"""Table of the truth and the estimates of one frame, as Markdown."""

from collections.abc import Mapping
from typing import Any, Final

from vbaa_bench.report.numbers import short
from vbaa_bench.viewer.frames import ViewedFrame

_HEAD: Final = "| method | x_c, mm | +- | force, mN | +- | outcome |\n|---|---:|---:|---:|---:|---|"


def markdown(frame: ViewedFrame) -> str:
    """Tabulate the truth and all estimates of a frame."""
    row = frame.row
    lines = [f"**{frame.title}**", "", _HEAD]
    lines.append(f"| true | {_cell(row['x_c_mm'])} | | {_cell(row['force_n'], 1e3)} | | |")
    lines += [_line(method, estimate) for method, estimate in frame.estimates.items()]
    lines += ["", f"frame {frame.row['frame_id']}, push {frame.row['push_id']}"]
    return "\n".join(lines)


def _line(method: str, row: Mapping[str, Any]) -> str:
    cells = (
        method,
        _cell(row["x_c_mm"]),
        _cell(row["x_c_sigma_mm"], digits=2),
        _cell(row["force_n"], 1e3),
        _cell(row["force_sigma_n"], 1e3, 2),
        row["outcome"],
    )
    return f"| {' | '.join(cells)} |"


def _cell(value: float | None, factor: float = 1.0, digits: int = 5) -> str:
    return "–" if value is None else short(factor * value, digits)
