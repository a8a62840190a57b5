"""A table of maps as the limits command computes it, with limits of known size."""

import polars as pl

from vbaa_bench.limits.designs import Design
from vbaa_bench.limits.maps import SCHEMA

DISTANCES = (20.0, 50.0, 80.0)
DEFLECTIONS = (5.0, 10.0)
DESIGNS = tuple(Design(name, (f"beam.length_mm={name}",), None) for name in ("200", "240"))


def table() -> pl.DataFrame:
    """Limits of x_c of 1 / deflection [% of L], twice as large in the second design.

    The force is 1 % of 1,000 mN over the contact distance [% of L]. Of each design, one place
    cannot be reached, and at another one psi cannot be determined.
    """
    rows = []
    for factor, design in enumerate(DESIGNS, 1):
        for distance in DISTANCES:
            for deflection in DEFLECTIONS:
                reached = (distance, deflection) != (80.0, 10.0)
                limits = {
                    "force_mn": 1000 / distance,
                    "x_c_limit_pct_L": factor / deflection,
                    "x_c_limit_mm": 2.4 * factor / deflection,
                    "force_limit_mn": 10 / distance,
                    "force_limit_pct": 1.0,
                    "psi_limit_deg": None if distance == 20 and deflection == 5 else 0.1,
                }
                rows.append(
                    {
                        "design": design.name,
                        "contact_distance_mm": 2.4 * distance,
                        "contact_distance_pct_L": distance,
                        "deflection_pct": deflection,
                        "information": "image",
                        "reason": None if reached else "the camera <sees> nothing",
                        **(limits if reached else {}),
                    }
                )
    return pl.DataFrame(rows, schema=SCHEMA, orient="row")
