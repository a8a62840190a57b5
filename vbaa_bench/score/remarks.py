"""What a scene breaks that a centreline hardly tells, in a sentence each, for tables of results."""

from typing import Any


def remarks(scene: dict[str, Any]) -> list[str]:
    """Sentences on a scene, as its manifest holds it; none where all assumptions are kept."""
    beam, touched, pushes = scene["beam"], scene["object"], scene["pushes"] or {}
    angles = pushes.get("pushing_angle_deg") or []
    found = {
        "Not told by the centreline: a tapered beam bends almost like a uniform one that is "
        "touched elsewhere, and the nominal rig says that it is uniform.": beam["tip_ratio"] != 1,
        "Not told by the centreline: an elliptic section changes the rigidity and turns the plane "
        "of bending, and the nominal rig says that it is round.": beam["section"] == "elliptic",
        "Not told by the centreline: the beam stretches, by less than a thousandth.": beam[
            "extensible"
        ],
        "The bow is seen in the rest images alone: who takes the rest for a straight line takes "
        "the bow for a bend.": beam["bow_mm"] != 0,
        "The sag is almost along the line of sight: the rest images show it by perspective "
        "alone.": any(scene["gravity_m_s2"]),
        "Not told by one frame: friction turns the force out of the normal; a force sensor at the "
        "clamp, or the whole push, tells it.": touched.get("friction", 0) > 0,
        "Not told by the image: the object moves by itself, which in a push looks like giving "
        "way.": any(touched.get("drift_mm") or []),
        "Where the second peg is touched no point contact makes the shape: a refusal is "
        "right.": scene["second_peg"] is not None,
        "At angles that are not positive nothing is touched.": any(angle <= 0 for angle in angles),
    }
    return [sentence for sentence, so in found.items() if so]
