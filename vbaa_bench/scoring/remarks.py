"""Remarks on violated assumptions that are hard to detect in the data, for tables of results."""

from typing import Any


def remarks(scene: dict[str, Any]) -> list[str]:
    """List remarks on a scene from a manifest; the list is empty if all assumptions hold."""
    beam, target = scene["beam"], scene["object"]
    pushes, sampling = scene["pushes"] or {}, scene["sampling"] or {}
    angles = pushes.get("pushing_angle_deg") or []
    normals = [*pushes.get("normal_deg", []), *sampling.get("normal_deg", [])]
    hangs = target["kind"] == "weight"
    flat = beam["section"] == "strip"  # its plane is known
    conditions = {
        "The clamp is offset from the motor axis. The nominal rig does not contain this offset, "
        "and a camera that rotates with the clamp cannot observe it in one image. The contact is "
        "correct in the antenna's frame; in the world's frame its error is the rotated offset, "
        "unless it was learned from pushes.": any(scene["clamp_offset_mm"]),
        "A tapered beam bends almost like a uniform one with another contact distance. Where the "
        "nominal rig does not state that its beam may be tapered, chi2 detects the taper only if "
        "the deflection is large relative to the noise.": beam["tip_ratio"] != 1,
        "Not observable from the centreline: a beam with elliptic section bends like a round one "
        "whose flexural rigidity depends on the direction of the force. The relative force error "
        "equals that of the rigidity, and chi2 stays near 1.": beam["section"] == "elliptic",
        "Not observable from the centreline: the beam stretches by less than 0.1 %, which moves "
        "its points along the beam and does not change its shape.": beam["extensible"],
        "The bow is measured in the rest images. Where it matters, exact_fit, exact_fit_3d and "
        "push_fit bend a beam with this bow; other methods subtract it to first order, which "
        "leaves the bow times the slope of the bent beam.": beam["bow_mm"] != 0,
        "The sag is almost along the line of sight, where it changes only the scale. rig.json "
        "states it as sag_mm; a method that neglects it has errors in all lengths.": (
            scene["gravity_m_s2"][2] != 0
        ),
        "The beam's own weight bends it in the plane of the pushes, otherwise at every motor "
        "angle. rig.json states it as sag_in_plane_mm; with the line at rest and the motor angle, "
        "the change of the bow follows.": any(scene["gravity_m_s2"][:2]),
        "The load hangs: its direction is fixed in the world, and it has a component along the "
        "beam. A method that assumes a force normal to the beam has errors that grow with the "
        "beam's slope.": hangs,
        "The clamp turns under its moment, which looks like an error of the encoder that grows "
        "with the force.": beam.get("clamp_softness", 0) > 0,
        "Not observable from one image: friction tilts the force away from the normal, and the "
        "tilted force bends the beam into almost the same shape, so that force and contact are "
        "biased while chi2 stays near 1, unless the rig states how much friction may occur. A "
        "force sensor at the clamp measures the tilt; push_fit_friction estimates it from all "
        "frames of a push.": (target.get("friction", 0) > 0),
        "Not observable from the image: the object moves by itself, which in a push looks like "
        "compliance.": any(target.get("drift_mm") or []),
        "Where the beam touches the second peg, no single point contact explains its shape: a "
        "refusal is right.": scene["second_peg"] is not None,
        "The beam bends in an inclined plane, which to first order looks like a smaller bend in "
        "plane C. Planar methods estimate the contact correctly and underestimate the force, or "
        "refuse frames whose residuals show it; exact_fit_3d also estimates the inclination.": (
            any(normals) and not flat
        ),
        "Steps with a pushing angle of zero or less have no contact.": not hangs
        and any(angle <= 0 for angle in angles),
    }
    return [sentence for sentence, applies in conditions.items() if applies]
