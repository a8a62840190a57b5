# The baselines of the paper's scenes, with the frames that they hold, and of the small scenes.
# WHY states why they are replaced.
WHY="${WHY:-made again}"
for entry in fig6_unknown_psi:70 fig8_rigid:270 fig9_knife_edge:45 fig11_stiffness:245 \
    fig13_occlusion:144 fig14_micro:36 camera_fixed:42; do
    scene="${entry%:*}"
    vbaa-bench run "scenes/$scene.yaml" --frames "${entry#*:}" --out "$RUNS/$scene" --no-limits
    cp "$FROM/$scene.json" "$OUT/"
    vbaa-bench compare "$RUNS/$scene" "$OUT/$scene.json" --save --why "$WHY"
done
mkdir -p "$OUT/small"
for path in tests/data/regression/*.yaml; do
    scene="$(basename "$path" .yaml)"
    vbaa-bench generate "$path" --out "$RUNS/$scene"
    vbaa-bench solve "$RUNS/$scene" --method linear_fit --method exact_fit --method exact_fit_3d
    vbaa-bench score "$RUNS/$scene"
    cp "$FROM/small/$scene.json" "$OUT/small/"
    vbaa-bench compare "$RUNS/$scene" "$OUT/small/$scene.json" --save --why "$WHY"
done
