"""Noise of the dirt on a beam, for information limits.

Where the dirt is drawn for every push or frame, its pattern is unknown, and changes the radiance
across the beam like noise that neighbouring pixels share. The image changes slowly along the beam
with the beam's shape and pose. So the dirt counts with its spectral density at low frequencies, and
the information of a pixel of the beam's length is S (N + P)^-1 S^T (Whittle 1953), with the
pixels' derivatives S, the variances N of the sensor's noise, and the density P of the dirt.
Specks of dust are neglected: a method may leave them out, which normal noise does not allow.
"""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.assembly.part_textures import beam_texture
from vbaa_bench.limits.profile import (
    STEP,
    SurfaceProfile,
    Variance,
    gray_profile,
    inside_profile,
    unit_cells,
)
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Patterns that are drawn, and frequencies [cycles per length of the beam], which a bent beam has.
# Chosen: their 32 squares determine a standard deviation to 9 %. The density decreases with
# frequency: at frequency 0 it would be that of changes that are slower than those of the beam.
_PATTERNS = 8
_FREQUENCIES = np.arange(1, 5)
# Number of the first pattern: beyond those of pushes, frames and rest images.
_FIRST = 2**50
# Places of a pixel's centre relative to the beam's. Measured: without dirt, half as many change the
# information of a beam of 0.7 px by less than 2 %.
_PHASES = 8


@dataclass(frozen=True)
class Dirt:
    """Mean of a beam's light over that of a clean one, and Fourier coefficients of its changes.

    `mean_diffuse` is that of the light that the paint scatters, `mean_specular` that of the light
    that it reflects. The coefficients `diffuse` and `specular` (n, k) are those of the changes
    relative to this mean, at the k offsets of `SurfaceProfile.radiance`.
    """

    mean_diffuse: float
    mean_specular: float
    diffuse: Floats
    specular: Floats

    def density(self, surface: SurfaceProfile, length_px: float) -> Floats:
        """Compute the spectral density (k, k) [radiance^2 px] of a beam of `length_px` pixels."""
        specular = surface.radiance - surface.diffuse
        change = self.diffuse * surface.diffuse + self.specular * specular
        return length_px * np.real(change.T @ change.conj()) / len(change)


def dirt_of(scene: Scene, rig: TrueRig, offsets: int) -> Dirt | None:
    """Draw patterns of dirt on the visible half of a scene's beam; None for a clean beam."""
    if scene.beam.grime is None:
        return None
    place = (np.arange(offsets) + 0.5) / offsets * 2 - 1
    around = np.arccos(-place) / np.pi
    clean = scene.beam.mean_reflectance
    grime = scene.beam.grime.model_copy(update={"dust_pct": 0.0})
    scene = scene.model_copy(update={"beam": scene.beam.model_copy(update={"grime": grime})})
    images, shines = [], []
    for number in range(_PATTERNS):
        texture = beam_texture(scene, rig, _FIRST + number)
        assert texture is not None
        assert texture.gloss is not None
        images.append(texture.image / clean)
        shines.append(texture.gloss)
    mean_diffuse, mean_specular = float(np.mean(images)), float(np.mean(shines))

    def coefficients(image: Floats) -> Floats:
        rows = image[np.minimum((around * len(image)).astype(int), len(image) - 1)]
        columns = rows.shape[1]
        waves = np.exp(-2j * np.pi * np.outer(_FREQUENCIES, np.arange(columns) / columns))
        return np.asarray(waves @ rows.T / columns)

    return Dirt(
        mean_diffuse,
        mean_specular,
        np.concatenate([coefficients(image / mean_diffuse) for image in images]),
        np.concatenate([coefficients(shine / mean_specular) for shine in shines]),
    )


def information_through_dirt(
    surface: SurfaceProfile, variance: Variance, density: Floats
) -> Floats:
    """Compute the information (4, 4) of one pixel of the beam's length, as `profile.information`.

    `density` (k, k) [radiance^2 px] is that of the dirt at the offsets of the surface.
    """
    profile = gray_profile(surface)
    cells = unit_cells(surface, profile.offset)
    inside = inside_profile(surface, profile.offset)
    per_pixel = round(1 / STEP)
    total = np.zeros((4, 4))
    for phase in range(_PHASES):
        at = slice(round(phase / _PHASES * per_pixel), None, per_pixel)
        shown = inside[at] > 0
        slopes, own = profile.slopes[:, at][:, shown], cells[:, at][:, shown]
        noise = variance(profile.mean[at][shown]) / inside[at][shown]
        lit = np.isfinite(noise)  # a saturated pixel shows nothing
        slopes, own = slopes[:, lit], own[:, lit]
        covariance = np.diag(noise[lit]) + own.T @ density @ own
        total += slopes @ np.linalg.solve(covariance, slopes.T)
    return total / _PHASES
