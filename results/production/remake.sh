# Fuzz and damage. Killed processes, clusters, full disks and export clients need other machines, or hours.
python -m tests.robustness.fuzz --seed 5301 --scenes 2000 --rigs 500 --tables 500 --images 500 --predictions 500 \
    --records 500 --settings 500 --page "$OUT/fuzz_table.md"
vbaa-bench generate scenes/quickstart.yaml --out "$RUNS/quickstart"
vbaa-bench solve "$RUNS/quickstart" --method exact_fit
vbaa-bench score "$RUNS/quickstart"
python -m tests.robustness.damage "$RUNS/quickstart" --trials 1000 --seed 5302 --out "$OUT/damage.md"
