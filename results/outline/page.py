"""The table and the page of reconstructed outlines."""

from collections.abc import Mapping, Sequence
from typing import Final

from results.outline.measure import Record
from vbaa_bench.scoring.tables import markdown_table

HEADS: Final = (
    "scene",
    "pushes",
    "distance, mean, % of L",
    "distance, largest, % of L",
    "outline in 3 sigma, %",
    "sigma / RMSE",
    "contacts in the 99.7 % ellipse, %",
    "contacts, RMSE, % of L",
    "contacts, sigma / RMSE",
)


def lines(records: Mapping[str, Sequence[Record]]) -> list[tuple[str, ...]]:
    """Format records by scene as rows of a table; HEADS are the columns."""
    return [
        (
            f"`{scene}`",
            str(one["pushes"]),
            f"{one['mean_distance_pct_L']:.2g}",
            f"{one['largest_distance_pct_L']:.2g}",
            f"{one['in_3_sigma_pct']:.1f}",
            f"{one['sigma_over_rmse']:.2f}",
            f"{one['contacts_in_ellipse_pct']:.1f}",
            f"{one['contact_rmse_pct_L']:.2g}",
            f"{one['contact_sigma_over_rmse']:.2f}",
        )
        for scene, parts in records.items()
        for one in parts
    ]


def markdown(records: Mapping[str, Sequence[Record]], command: str) -> str:
    """Write the page; the pictures beside it are named by the scenes."""
    rows = markdown_table(HEADS, lines(records))
    pictures = "\n\n".join(f"![Outline of {scene}]({scene}.png)" for scene in records)
    return f"""# Outlines of unknown objects

A carriage brings the antenna to an object on a table, from all sides. Every push is one rendered
image, from which `exact_fit` estimates the contact and the direction of the force. The readings of
the carriage and of the motor place these on the table, and `python -m solver outline` fits the
boundary of a convex region to them. The rig is drawn with its tolerances as sigmas. The cam
(`outline`) and the hexagon were used in development, with other seeds; the plectrum was not.

`{command}`

{rows}

- The *distance* is that of 2,000 points of the estimated outline from the section of the object's
  mesh in plane C.
- The *outline in 3 sigma* compares the extent of outline and mesh along every half degree of the
  normal. The sigma includes what is between two contacts, and the error of the antenna's frame,
  which all contacts share. *sigma / RMSE* is the median sigma over the RMSE of these extents.
- A contact is in its *ellipse* if its error in two dimensions is within the 99.7 % ellipse of its
  stated covariance. The RMSE of contacts is mostly along the beam, and so along the outline, which
  hardly moves it.
- The outline is that of the convex hull: a straight beam that is longer than the object cannot
  touch a dent. The table of the outline has the distance to the nearest contact for that reason.

Left: outline (black), mesh (green), and contacts (red) with the direction of the force and enlarged
ellipses. Right: extent of the outline less that of the mesh (line) within three sigmas (gray), and
errors of the contacts along the normal (dots). The sigma is large on a flat side, where the two
neighbouring contacts have almost the same normal and are far apart.

{pictures}
"""
