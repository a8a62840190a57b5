"""Share of the information in its data that a method uses, in words."""

from typing import Any, Final

from vbaa_bench.scoring.information_sets import SETS

_QUANTITIES: Final = {
    "x_c_mm": "the contact distance",
    "s_c_mm": "the contact arc length",
    "force_n": "the force",
    "psi_deg": "the inclination psi",
    "compliance_mm_per_n": "the compliance",
    "second_s_c_mm": "the second contact's arc length",
    "second_force_n": "the second force",
}
# A share above 100 % is called impossible only with this many answered frames. Chosen: bootstrap
# intervals of fewer are too narrow; with 20 Gaussian errors by a tenth.
_MIN_FRAMES: Final = 20


def efficiency(information: str, row: dict[str, Any]) -> dict[str, Any] | None:
    """Compute the share of the information that is used, from a row of `strata_rows`.

    It is (RMS of error / limit)^-2 of the answered frames, as `efficiency_pct`, with the 95 %
    interval `efficiency_pct_95` and a `sentence`. None without limits. An unbiased method cannot
    use more than all information (Cramer and Rao); where the whole interval is above 100 %, the
    result is `impossible`: there is no share, and the sentence names the likely reasons instead.
    """
    rmse = row["rmse_over_limit"]
    if not rmse:
        return None
    low, high = row["rmse_over_limit_low"], row["rmse_over_limit_high"]
    percent, ends = 100 / rmse**2, None if not low else [100 / high**2, 100 / low**2]
    about, data = _QUANTITIES[row["quantity"]], SETS[information]
    impossible = bool(ends and ends[0] > 100 and row["answered"] >= _MIN_FRAMES)
    if impossible:
        sentence = (
            f"has errors of {rmse:.2g} times the limit for {about} from {data}, which is "
            "impossible for an unbiased method: either the true rig is nearer to the nominal one "
            "than its tolerances and its statements about beam and objects permit, or the method "
            f'uses data or priors that the information set "{information}" lacks, or its bias '
            f"({row['bias_over_limit']:.2g} of the limit) or its choice of answered frames "
            f"({row['answered']} of {row['frames']}) reduces its errors, or the limit is wrong"
        )
    else:
        span = f" ({ends[0]:.3g} to {ends[1]:.3g} %)" if ends else ""
        sentence = f"uses {percent:.3g} %{span} of the information in {data} about {about}"
    return {
        "efficiency_pct": None if impossible else percent,
        "efficiency_pct_95": None if impossible else ends,
        "impossible": impossible,
        "sentence": sentence,
    }
