# Fuzz and damage. Killed processes, clusters, full disks and export clients need other machines, or hours.
python -m tests.robustness.fuzz --seed 61 --page "$OUT/fuzz.md"
vbaa-bench generate scenes/quickstart.yaml --out "$RUNS/quickstart"
vbaa-bench solve "$RUNS/quickstart" --method exact_fit
vbaa-bench score "$RUNS/quickstart"
python -m tests.robustness.damage "$RUNS/quickstart" --trials 1000 --seed 1 --out "$OUT/damage.md"
