"""Remarks on violated assumptions that are hard to detect in the data, for tables of results."""

from typing import Any


def remarks(scene: dict[str, Any]) -> list[str]:
    """List remarks on a scene from a manifest; the list is empty if all assumptions hold."""
    beam, touched = scene["beam"], scene["object"]
    pushes, sampling = scene["pushes"] or {}, scene["sampling"] or {}
    angles = pushes.get("pushing_angle_deg") or []
    normals = [*pushes.get("normal_deg", []), *sampling.get("normal_deg", [])]
    flat = beam["section"] == "strip"  # its plane is known
    found = {
        "Not told by the images: the clamp stands off the axis of rotation, of which the rig says "
        "nothing and a camera that turns with the clamp sees nothing; the contact is right in the "
        "antenna's frame, and in the world's frame off by this offset turned.": any(
            scene["clamp_offset_mm"]
        ),
        "Told in part alone: a tapered beam bends almost like a uniform one that is touched "
        "elsewhere, which the nominal rig says it is, so that chi2 shows the taper only where the "
        "bend is large against the noise.": beam["tip_ratio"] != 1,
        "Not told by the centreline: an elliptic section bends like a round one of another "
        "rigidity, which depends on the direction of the force, so that the force errs by as much "
        "as the rigidity while chi2 stays at one.": beam["section"] == "elliptic",
        "Not told by the centreline: the beam stretches by less than a thousandth, which moves its "
        "points along itself and hence not in the image.": beam["extensible"],
        "The bow is seen in the rest images alone and is taken off the bent beam to first order: "
        "what is left is its size times the slope of the bend, and who takes the rest for a "
        "straight line takes the bow for a bend.": beam["bow_mm"] != 0,
        "The sag is almost along the line of sight, where it changes the scale alone: rig.json "
        "states it as sag_mm, and who neglects that errs in all lengths.": any(
            scene["gravity_m_s2"]
        ),
        "Not told by one image: friction turns the force out of the normal, and a force of another "
        "direction bends the beam almost into the same shape, so that chi2 stays near one while "
        "force and contact are biased; a force sensor at the clamp tells it, and the frames of a "
        "push together, as push_fit_friction takes them.": (touched.get("friction", 0) > 0),
        "Not told by the image: the object moves by itself, which in a push looks like giving "
        "way.": any(touched.get("drift_mm") or []),
        "Where the second peg is touched no point contact makes the shape: a refusal is "
        "right.": scene["second_peg"] is not None,
        "The beam bends in an inclined plane, which to first order looks like a smaller bend in "
        "plane C: planar methods find the contact and miss part of the force, exact_fit_3d answers "
        "the inclination too.": any(normals) and not flat,
        "At angles that are not positive nothing is touched.": any(angle <= 0 for angle in angles),
    }
    return [sentence for sentence, so in found.items() if so]
