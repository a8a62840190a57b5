"""Reconstruct the outline from the estimates of a dataset, and score it."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.stats import chi2

from results.outline.true_outline import TrueOutline, evenly
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Outcome
from solver.instrument.observation import open_observations
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from solver.lab.outline_command import read_estimates
from solver.outline.contacts import Contacts, contacts_of
from solver.outline.fit import MIN_CONTACTS, Outline, fit_outline
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.results_layout import Results

# Probability of three sigmas of one normal error; of two, the ellipse has this probability.
THREE_SIGMAS: Final = math.erf(3 / math.sqrt(2))
# Shares of the frames from which outlines are reconstructed.
PARTS: Final = (4, 2, 1)

Record = dict[str, Any]


@dataclass(frozen=True)
class Reconstruction:
    """An outline and its contacts, with the `errors` (n, 2) [m] of these, and the truth."""

    outline: Outline
    contacts: Contacts
    errors: Floats
    truth: TrueOutline


def measure(outline: TrueOutline, root: Path, method: str) -> tuple[list[Record], Reconstruction]:
    """Score outlines from a quarter, a half and all of a dataset's pushes.

    Returns a record for each part that has contacts enough, with lengths in % of L, and the last
    reconstruction. Raises InputError.
    """
    results = Results(root)
    observations = open_observations(results.dataset.observations)
    rows = read_estimates(results.predictions / f"{method}.csv")
    truth = open_truth(results.dataset.truth, centrelines=False).frames
    numbers = dict(zip(truth["frame_id"], truth["trial"], strict=True))
    true_points = dict(zip(truth["frame_id"], truth["touched_table_mm"], strict=True))
    records = []
    for part in PARTS:
        count = len(rows) // part
        chosen = [row for row in rows if numbers[row["frame_id"]] < count]
        touching = sum(row["outcome"] == Outcome.CONTACT for row in chosen)
        if touching < MIN_CONTACTS and part > 1:
            continue
        contacts = contacts_of(chosen, observations.frames, observations.rig)
        true = np.array([true_points[name][:2] for name in contacts.frame_ids]) * MILLIMETRE
        reconstruction = Reconstruction(
            fit_outline(contacts), contacts, contacts.points - true, outline
        )
        length = observations.rig.beam.length
        records.append({"pushes": count, **_record(reconstruction, length)})
    return records, reconstruction


def _record(one: Reconstruction, length: float) -> Record:
    outline, contacts, percent = one.outline, one.contacts, PERCENT * length
    distances = one.truth.distances(evenly(outline.points, outline.closed))
    normals = np.column_stack([np.cos(outline.normals), np.sin(outline.normals)])
    offsets = (outline.points * normals).sum(axis=1) - one.truth.support(normals)
    covariances = contacts.total_covariances()
    squared = np.einsum("ni,nij,nj->n", one.errors, np.linalg.inv(covariances), one.errors)
    stated = np.sqrt(np.trace(covariances, axis1=1, axis2=2))
    corrected = one.errors - contacts.shared @ outline.correction
    return {
        "contacts": len(contacts.points),
        "rejected": int((~outline.used).sum()),
        "closed": outline.closed,
        "mean_distance_pct_L": float(distances.mean() / percent),
        "largest_distance_pct_L": float(distances.max() / percent),
        "in_3_sigma_pct": 100 * float(np.mean(np.abs(offsets) <= 3 * outline.sigmas)),
        "sigma_over_rmse": float(np.median(outline.sigmas) / _rms(offsets)),
        "contact_rmse_pct_L": _rms(np.linalg.norm(one.errors, axis=1)) / percent,
        "corrected_contact_rmse_pct_L": _rms(np.linalg.norm(corrected, axis=1)) / percent,
        "contacts_in_ellipse_pct": 100 * float(np.mean(squared <= chi2.ppf(THREE_SIGMAS, 2))),
        "contact_sigma_over_rmse": float(
            np.median(stated) / _rms(np.linalg.norm(one.errors, axis=1))
        ),
        "turn_deg": float(outline.correction[2] / DEGREE),
        "turn_sigma_deg": float(outline.correction_sigmas[2] / DEGREE),
    }


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
