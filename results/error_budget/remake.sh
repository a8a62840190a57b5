# after.csv. before.csv holds shares of an earlier version, and cannot be made again.
generate() {
    vbaa-bench generate "scenes/$1.yaml" --out "$RUNS/$(basename "$1")" "${@:2}"
}
generate fig8_rigid
generate fig11_stiffness --frames 245
generate fig13_occlusion --frames 144
planar=(fig8_rigid fig11_stiffness fig13_occlusion)
for scene in adaptor at_the_tip behind_bars behind_leaves bow elliptic float_huge float_tiny friction \
    gravity large_deflection moving_object near_base stretch taper tiny_deflection two_pegs; do
    generate "hard/$scene"
    planar+=("$scene")
done
generate fig6_unknown_psi --frames 70
generate fig9_knife_edge --frames 45
generate hard/psi_near_90
cd "$RUNS"
vbaa-bench budget "${planar[@]}" --method exact_fit --out planar.csv
vbaa-bench budget fig6_unknown_psi fig9_knife_edge psi_near_90 fig8_rigid --method exact_fit_3d --out inclined.csv
vbaa-bench budget fig8_rigid --method linear_fit --method two_point --out linear.csv
{ cat planar.csv; tail -n +2 inclined.csv; tail -n +2 linear.csv; } > "$OUT/after.csv"
