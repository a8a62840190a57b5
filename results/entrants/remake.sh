# The entrants of docs/entrants.md on the paper's rig. The prediction by regression needs the extra 'learned'.
export PYTHONPATH=docs/entrants/consistent_sections:docs/entrants/spline_curvature
vbaa-bench generate scenes/fig8_rigid.yaml --out "$RUNS/fig8_rigid"
vbaa-bench solve "$RUNS/fig8_rigid" --method consistent_sections:estimate --method spline_curvature:estimate \
    --method exact_fit
python -m results.learned "$RUNS/fig8_rigid" --predictions
vbaa-bench score "$RUNS/fig8_rigid"
cp "$RUNS/fig8_rigid/scores/summary.json" "$OUT/"
