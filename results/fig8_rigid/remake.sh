# Report, pictures, scores and error budget of the paper's rig.
vbaa-bench generate scenes/fig8_rigid.yaml --out "$RUNS/fig8_rigid"
vbaa-bench limits "$RUNS/fig8_rigid"
vbaa-bench solve "$RUNS/fig8_rigid"
vbaa-bench score "$RUNS/fig8_rigid"
vbaa-bench budget "$RUNS/fig8_rigid" --method exact_fit
vbaa-bench report "$RUNS/fig8_rigid"
cp "$RUNS/fig8_rigid"/report/{report.html,overlay.png,speed_against_error.png} "$OUT/"
cp "$RUNS/fig8_rigid/scores/summary.json" "$RUNS/fig8_rigid/derived/budget.json" "$OUT/"
# The paper's own centreline.
vbaa-bench solve "$RUNS/fig8_rigid" --method two_point --method exact_fit --centreline area_weighted
vbaa-bench score "$RUNS/fig8_rigid"
vbaa-bench table "$RUNS/fig8_rigid" --by push --format csv > "$OUT/by_push.csv"
