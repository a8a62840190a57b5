# The camera of the paper's rig, calibrated from rendered boards.
python -m results.calibration scenes/fig8_rigid.yaml --json > "$OUT/calibration.json"
