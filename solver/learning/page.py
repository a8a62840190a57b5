"""What was learned of a beam, in words and as a page with pictures."""

import math
from html import escape
from typing import Final

import numpy as np
from scipy.constants import g

from solver.beams.stretch import width_at
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import (
    CLAMP_SHIFT,
    FIRST_WIDTH,
    SKEW,
    SOFTNESS,
    BeamShape,
)
from solver.instrument.rig import Rig
from solver.instrument.units import GRAM, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE, PERCENT
from solver.learning.clamp_offset import LearnedOffset
from solver.learning.learn import LearnedBeam
from solver.learning.next_push import NextForce, NextPush

# Distance of two values, in sigmas of their difference, from which they contradict each other.
_CONTRADICTION: Final = 3.0
# Size of a picture [px], and its margins.
_WIDTH, _HEIGHT, _MARGIN = 640, 220, 60
# Ratio of the sigmas of a clamp's offset above which the objects' radius is the cause. Measured:
# without the radius 4 to 6, with it 3.
_CONFOUNDED: Final = 4.0
# Ratio of the sigmas of x_c with and without a push above which it is not advised. Chosen.
_USELESS: Final = 0.99
_PLACES: Final = np.linspace(0.0, 1.0, 81)


def widths_of(shape: BeamShape) -> tuple[Floats, Floats]:
    """Compute the width over that at the clamp, and its sigma, at 81 places (81,) of the beam."""
    rows = np.zeros((len(_PLACES), len(shape.widths)))
    values = np.ones(len(_PLACES))
    for i, s in enumerate(_PLACES):
        values[i], _ = width_at(s, shape.widths, rows[i])
    of_widths = slice(FIRST_WIDTH, FIRST_WIDTH + len(shape.widths))
    covariance = shape.covariance[of_widths, of_widths]
    return values, np.sqrt(np.maximum(((rows @ covariance) * rows).sum(axis=1), 0.0))


def bow_of(shape: BeamShape, length: float) -> tuple[Floats, Floats]:
    """Compute the line at rest [mm] less its tangent at the clamp, and its sigma, at 81 places."""
    if not len(shape.bow):
        return np.zeros(len(_PLACES)), np.zeros(len(_PLACES))
    powers = np.column_stack([_PLACES ** (j + 2) for j in range(len(shape.bow))])
    covariance = shape.covariance[-len(shape.bow) :, -len(shape.bow) :]
    unit = length / MILLIMETRE
    variance = ((powers @ covariance) * powers).sum(axis=1)
    return np.asarray(powers @ shape.bow * unit), np.sqrt(np.maximum(variance, 0.0)) * unit


def summary(beam: LearnedBeam, rig: Rig, stated: Rig) -> str:
    """Describe a learned beam in a few lines.

    `rig` contains it, and EI if a force was known; `stated` is the rig before.
    """
    length = rig.beam.length
    values, sigmas = widths_of(beam.shape)
    lines = [
        f"{beam.chosen.name}, from the {beam.frames} of {beam.measured} frames that show one "
        f"contact; residuals {np.sqrt(beam.misfit):.2f} sigma",
        f"width at the tip over that at the clamp: {values[-1]:.5f} +- {sigmas[-1]:.2g}",
    ]
    if beam.chosen.soft:
        lines.append(
            f"rotation of the clamp over its moment, in L / EI: {beam.shape.softness:.5f} "
            f"+- {beam.shape.sigma(SOFTNESS):.2g}"
        )
    if beam.chosen.shifted:
        shift, sigma = (
            v * length / MILLIMETRE for v in (beam.shape.clamp_shift, beam.shape.sigma(CLAMP_SHIFT))
        )
        lines.append(f"the beam begins to bend {shift:.3f} +- {sigma:.2g} mm beyond its clamp")
    elif beam.chosen.soft:
        lines.append(_alike(beam.shape, length))
    if beam.shape.section_sigma:
        skew, sigma = (np.degrees(v) for v in (beam.shape.skew, beam.shape.sigma(SKEW)))
        lines.append(
            f"angle from the plane of the force to that of the deflection: {skew:.2f} +- "
            f"{sigma:.2g} degrees"
        )
    if beam.shape.friction_coefficient:
        coefficient, sigma = beam.shape.friction
        lines.append(
            f"coefficient of friction of objects like these: {coefficient:.2f} +- {sigma:.2f}"
        )
    if beam.offset is not None:
        lines.append(_offset(beam.offset))
    if beam.next_push is not None:
        lines.append(_advice(beam.next_push, length))
    lines.append(_rigidity(rig, stated))
    if beam.next_force is not None:
        lines.append(_force(beam.next_force, rig))
    return "\n".join(lines)


def _rigidity(rig: Rig, stated: Rig) -> str:
    """Describe EI at the clamp, and how far it is from the stated one if a force was known."""
    unit = NEWTON_SQUARE_MILLIMETRE
    value, sigma = rig.beam.flexural_rigidity / unit, _rigidity_sigma(rig) / unit
    before, sigma_before = stated.beam.flexural_rigidity / unit, _rigidity_sigma(stated) / unit
    text = f"EI at the clamp: {value:.5g} +- {sigma:.2g} N mm^2"
    if value == before:
        return f"{text}, as stated: images show only how it changes along the beam"
    text += f", by the known force; the rig states {before:.5g} +- {sigma_before:.2g}"
    apart = abs(value - before) / max(math.hypot(sigma, sigma_before), 1e-300)
    if apart > _CONTRADICTION:
        text += (
            f", {apart:.0f} sigmas away: check the force, its unit and its frame, and "
            "beam.flexural_rigidity_n_mm2"
        )
    return text


def _rigidity_sigma(rig: Rig) -> float:
    """Compute the sigma of EI, by its tolerance and by a section that is not round."""
    return math.hypot(
        rig.tolerances.flexural_rigidity, rig.shape.rigidity_sigma * rig.beam.flexural_rigidity
    )


def _alike(shape: BeamShape, length: float) -> str:
    """Describe the other clamp that would look like a compliant one."""
    before = shape.softness * length / MILLIMETRE
    side, farther = ("before", "farther from") if before >= 0 else ("beyond", "nearer to")
    return (
        f"a beam that begins to bend {abs(before):.2f} mm {side} its clamp would look the same, "
        f"and have contacts as much {farther} where it begins: if it may, state "
        "beam_shape.clamp_shift_sigma_mm in the rig.json that this was learned with, and learn "
        "again"
    )


def _offset(learned: LearnedOffset) -> str:
    """Describe the clamp's offset from the motor's axis, and whether it is used."""
    position = learned.offset.position / MILLIMETRE
    sigmas = np.sqrt(np.diag(learned.offset.covariance)) / MILLIMETRE
    x, y = (f"{v:.2f} +- {s:.2g}" for v, s in zip(position, sigmas, strict=True))
    text = f"clamp's offset from the motor's axis: x {x} mm, y {y} mm"
    if not learned.still:
        return (
            f"{text}; not used, because the objects moved, yielded or slipped: chi^2 of the "
            f"contacts is {learned.chi2:.3g} on {learned.dof} degrees of freedom"
        )
    if not learned.needed:
        return f"{text}; the rig's agrees with the pushes, and is kept"
    if sigmas[1] > _CONFOUNDED * sigmas[0]:
        text += "; the objects' radius, with --object-radius, would determine it in both directions"
    return text


def _advice(push: NextPush, length: float) -> str:
    """Describe the push that would determine best what remains uncertain."""
    if push.after > _USELESS * push.before:
        return (
            f"no push would reduce the sigma of x_c in usual pushes, {push.before * 100:.3f} % of "
            "the length, by more than 1 %"
        )
    sigmas = f"{push.before * 100:.3f} to {push.after * 100:.3f} % of the length"
    place, deflection = (of * length / MILLIMETRE for of in (push.place, push.deflection))
    return (
        f"the next push that helps most: contact at {place:.0f} mm, tip deflected by "
        f"{deflection:.0f} mm; it would reduce the sigma of x_c in usual pushes from {sigmas}"
    )


def _force(known: NextForce, rig: Rig) -> str:
    """Describe what is known of EI, and the force that would determine it."""
    beam = rig.beam
    relative = _rigidity_sigma(rig) / beam.flexural_rigidity
    text = f"EI, and with it all forces, is known to {relative / PERCENT:.2g} %"
    if relative < known.before / 2:
        return text
    place, deflection = (of * beam.length / MILLIMETRE for of in (known.place, known.deflection))
    force = known.force * beam.flexural_rigidity / beam.length**2
    return (
        f"{text}; a known force of about {force:.2g} N, or a weight of {force / g / GRAM:.2g} "
        f"g, at {place:.0f} mm, in the plane of the pushes, would determine it to "
        f"{known.after / PERCENT:.2g} %: the tip is deflected by {deflection:.0f} mm"
    )


def page(beam: LearnedBeam, rig: Rig, stated: Rig) -> str:
    """Write an HTML page: the beam that was chosen, its width and bow, and the candidates."""
    width, width_sigma = widths_of(beam.shape)
    bow, bow_sigma = bow_of(beam.shape, rig.beam.length)
    rows = "".join(
        f"<tr><td>{escape(trial.candidate.name)}</td><td>{trial.misfit:.4f}</td>"
        f"<td>{trial.excess:.4f}</td></tr>"
        for trial in beam.trials
    )
    length = rig.beam.length / MILLIMETRE
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width"><title>A learned beam</title>'
        f"<style>{_STYLE}</style></head><body><h1>A learned beam</h1>"
        f"<pre>{escape(summary(beam, rig, stated))}</pre>"
        "<h2>Width along the beam, % of that at the clamp, with two sigmas</h2>"
        "<p>The horizontal axis is the distance from the clamp in mm.</p>"
        f"{_picture(length, width / PERCENT, width_sigma / PERCENT)}"
        "<h2>Line at rest [mm], with two sigmas</h2>"
        f"{_picture(length, bow, bow_sigma)}"
        "<h2>Beams that were compared</h2><p>Mean square of the residuals, in sigmas, of pushes "
        "that each was not learned from; and its excess over the best. The first that is as good "
        "as the best, within the noise, is chosen.</p>"
        f"<table><tr><th>beam</th><th>misfit</th><th>excess</th></tr>{rows}</table>"
        "<p>EI is the flexural rigidity, sigma the standard deviation of an error, and x_c the "
        "distance of a contact from the clamp. Contacts at 30 to 90 % of the length that deflect "
        "the tip by 5 to 20 % of it are usual pushes. A beam is compared only with those that have "
        "at least the freedom that the rig states, such as a taper.</p></body></html>\n"
    )


_STYLE: Final = (
    ":root{color-scheme:light dark}body{font:16px/1.5 system-ui,sans-serif;max-width:680px;"
    "margin:2rem auto;padding:0 1rem}svg{width:100%;height:auto}pre{white-space:pre-wrap}"
    "td,th{padding:.2rem .8rem .2rem 0;text-align:left}svg text{fill:currentColor;"
    "font:13px system-ui,sans-serif}@media(max-width:500px){svg text{font-size:20px}}"
    ".line{stroke:currentColor;fill:none}"
    ".band{fill:#0b57d0;opacity:.25}.axis{stroke:currentColor;opacity:.3}"
)


def _round_numbers(low: float, high: float) -> Floats:
    """Return the two to five multiples of 1, 2 or 5 times a power of ten from `low` to `high`."""
    power = 10.0 ** np.floor(np.log10((high - low) / 2))
    step = power * max(factor for factor in (1, 2, 5) if factor * power <= (high - low) / 2)
    # The sum makes a positive zero of a negative one.
    return np.asarray(np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step) + 0.0


def _picture(length_mm: float, values: Floats, sigmas: Floats) -> str:
    """Draw values (81,) along the beam and a band of two sigmas as SVG."""
    low, high = float((values - 2 * sigmas).min()), float((values + 2 * sigmas).max())
    pad = max(0.05 * (high - low), 1e-3 * max(abs(low), abs(high), 1e-3))
    low, high = low - pad, high + pad
    x = _MARGIN + _PLACES * (_WIDTH - _MARGIN - 10)

    def y(of: Floats) -> Floats:
        return np.asarray(10 + (high - of) / (high - low) * (_HEIGHT - 40))

    def path(x_values: Floats, y_values: Floats) -> str:
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x_values, y_values, strict=True))

    band_x = np.append(x, x[::-1])
    band_y = np.append(y(values + 2 * sigmas), y(values - 2 * sigmas)[::-1])
    ticks = _round_numbers(low, high)
    grid = "".join(
        f'<path class="axis" d="M{_MARGIN} {level:.1f}H{_WIDTH - 10}"/>'
        f'<text x="2" y="{level + 4:.1f}">{tick:.6g}</text>'
        for tick, level in zip(ticks, y(ticks), strict=True)
    )
    places = "".join(
        f'<text x="{x[i]:.0f}" y="{_HEIGHT - 8}" text-anchor="{anchor}">'
        f"{_PLACES[i] * length_mm:.4g}</text>"
        for i, anchor in ((0, "start"), (40, "middle"), (80, "end"))
    )
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img">{grid}{places}'
        f'<polygon class="band" points="{path(band_x, band_y)}"/>'
        f'<polyline class="line" points="{path(x, y(values))}"/></svg>'
    )
