# Loading frames with PyTorch; needs the extra 'torch'.
vbaa-bench generate scenes/quickstart.yaml --out "$RUNS/quickstart"
vbaa-bench generate results/production/sixteen_bits.yaml --out "$RUNS/sixteen_bits"
vbaa-bench generate scenes/fig8_rigid.yaml --out "$RUNS/fig8_rigid"
python -m results.loading_speed "$RUNS/quickstart" "$RUNS/sixteen_bits" "$RUNS/fig8_rigid" --out "$OUT/README.md"
