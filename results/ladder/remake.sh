# The ladder on the paper's rig, and on eight rigs that differ from it by their tolerances.
vbaa-bench generate scenes/fig8_rigid.yaml --out "$RUNS/fig8_rigid"
vbaa-bench generate scenes/fig8_rigid.yaml --out "$RUNS/drawn" --seed 2002 --frames 27 --set rigs=8 \
    --set tolerances.true_rig=drawn
vbaa-bench limits "$RUNS/fig8_rigid"
vbaa-bench limits "$RUNS/drawn"
python -m results.ladder "$RUNS/fig8_rigid" "$RUNS/drawn" --out "$OUT"
