# Scoring and reporting 100,000 frames.
vbaa-bench run scenes/fig8_rigid.yaml --out "$RUNS/fig8_rigid"
python -m results.score_speed "$RUNS/fig8_rigid" --json > "$OUT/score_speed.json"
