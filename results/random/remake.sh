# 25 rigs of each scene; a hundred take more than 90 minutes on two cores. Limits of random/hard,
# with six assumptions violated in each rig, take minutes a rig.
for entry in rigs:9501 looks:9502 hard:9503; do
    scene="${entry%:*}"
    limits=""
    if [ "$scene" = hard ]; then limits="--no-limits"; fi
    # shellcheck disable=SC2086
    vbaa-bench run "scenes/random/$scene.yaml" --seed "${entry#*:}" --rigs 0:25 --repeats 1 $limits \
        --method exact_fit --out "$RUNS/$scene"
    cp "$RUNS/$scene/scores/factors.csv" "$OUT/${scene}_factors.csv"
    cp "$RUNS/$scene/scores/summary.json" "$OUT/${scene}_summary.json"
done
cd "$RUNS"
python -m results.random rigs looks hard --out "$OUT/thresholds.csv"
