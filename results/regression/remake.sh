for seed in $(seq 101 124); do
    vbaa-bench run scenes/quickstart.yaml --seed "$seed" --no-limits --out "$RUNS/seeds/$seed"
done
python -m results.regression "$RUNS"/seeds/* --json > "$OUT/seeds.json"
