"""Texts of Croissant documents: citation, and RAI 1.0 properties of the data."""

from typing import Final

BIBTEX: Final = (
    "@misc{{vbaa_bench, title={{VBAA-Bench: a physically rendered benchmark for vision-based "
    "active antennas}}, author={{{{The VBAA-Bench authors}}}}, version={{{version}}}}}"
)

RAI: Final = {
    "rai:dataCollection": (
        "Synthetic. The equilibrium of a flexible beam that is pushed against an object is "
        "computed (planar elastica, or a Kirchhoff rod in space); meshes of the beam, the "
        "object and the laboratory are rendered; a model of an image sensor adds noise and "
        "quantises. Every value of the truth is the input or the result of this computation."
    ),
    "rai:dataCollectionType": ["Software Collection"],
    "rai:dataCollectionMissingData": (
        "A value that does not exist is null, such as the contact distance of a beam that "
        "touches nothing. A frame that could not be computed is not in the tables; "
        "failures.json of its shard states the reason."
    ),
    "rai:dataPreprocessingProtocol": ["None: images are stored as the sensor model delivers them."],
    "rai:dataAnnotationProtocol": ["No annotator: labels are computed before the image."],
    "rai:machineAnnotationTools": ["VBAA-Bench", "Mitsuba 3"],
    "rai:dataLimitations": [
        "Images are rendered, not photographed. Materials, lamps and the sensor are models; a "
        "method that is trained on them alone has not been shown to work with a real camera.",
        "A scene has the rig, beams, objects and lights that it states. Conclusions hold for these "
        "ranges, which truth/manifest.json (rigs/*/truth_manifest.json in exports) lists.",
        "Where a scene violates an assumption that no image shows, such as friction, the stated "
        "sigma of a method cannot include the resulting error.",
    ],
    "rai:dataBiases": [
        "Pushes follow the grid or the distributions of the scene, not their frequency in use.",
    ],
    "rai:dataUseCases": [
        "Comparison of methods that estimate contact distance, force, plane of bending and "
        "stiffness from an image of a bent beam, and training of such methods.",
        "Not suitable: safety limits of a real machine without measurements on that machine.",
    ],
    "rai:personalSensitiveInformation": ["None: the images show no persons."],
    "rai:dataSocialImpact": "None known: laboratory objects only.",
    "rai:dataReleaseMaintenancePlan": (
        "A dataset does not change: it is identified by its scene, seed, code and package "
        "versions (truth/identity.json), from which the same bytes can be generated again."
    ),
}

PROBLEM: Final = (
    "Estimate from each image of a bent beam where the beam touches an object (contact distance"
    " x_c), how hard (force), in which plane (psi) and how stiff the object is (k_s), with a "
    "standard deviation of each estimate; or state why no estimate is possible."
)
RULES: Final = (
    "A method receives rig.json, the board views, the rest images, the images of the frames and"
    " the readings, and nothing of the truth: neither labels, nor truth/manifest.json, nor the "
    "scene. It must not be tuned on the frames on which it is scored; frames of one push, and "
    "rigs of a split by rig, are never in two splits. Every frame is answered or counts as a "
    "failure."
)
EVALUATION: Final = (
    "Every frame is scored. Errors are computed from the frames with an estimate, and failures "
    "are counted beside them; a second RMSE counts a failure as an error of L/2. An outcome "
    "without values is right where the truth allows it. Honesty: an estimate is consistent if "
    "its error is at most three of its stated standard deviations; coverage at 68 and 95 % and "
    "NEES are reported with the errors. Errors are divided, frame by frame, by the information "
    "limit (Cramer and Rao), the least standard deviation without bias: 1 is the best possible "
    "RMSE over the limit. Intervals are 95 % bootstrap intervals over pushes."
)
# Names, units and definitions of the metrics.
METRICS: Final = (
    ("x_c_rmse_pct_L", "% of L", "root mean square error of the contact distance"),
    ("x_c_median_abs_pct_L", "% of L", "median absolute error of the contact distance"),
    ("x_c_rmse_all_pct_L", "% of L", "the same RMSE; a failure counts as an error of L/2"),
    ("force_rmse_pct", "%", "root mean square error of the force, relative to its true value"),
    ("psi_rmse_deg", "deg", "root mean square error of the plane of bending"),
    ("compliance_rmse_pct", "%", "root mean square error of 1/k_s, relative to its true value"),
    ("rmse_over_limit", "1", "root mean square of error over information limit"),
    ("coverage_95", "1", "share of errors within 1.96 stated standard deviations; right is 0.95"),
    ("nees", "1", "mean squared error in stated standard deviations; right is 1"),
    ("consistent_rate", "1", "share of frames that are consistent or rightly refused"),
    ("failure_rate", "1", "share of frames without the required values, or with a wrong outcome"),
    ("ms_per_frame_median", "ms", "median time from the image in memory to the estimate"),
)
