# All methods on the scenes of the paper and on the hard ones, beside the limits.
run() {
    vbaa-bench run "scenes/$1.yaml" --repeats 1 --out "$RUNS/$(basename "$1")" "${@:2}"
}
run fig8_rigid
run fig6_unknown_psi --frames 70
run fig9_knife_edge --frames 45
run fig11_stiffness --frames 245
run fig13_occlusion --frames 144
run fig14_micro --frames 36
run camera_fixed --frames 42
for scene in fig2_sliding_edge fig5_line_contact camera_moving linear_beam va_flat_strip; do
    run "$scene" --frames 40
done
for path in scenes/hard/*.yaml; do
    run "hard/$(basename "$path" .yaml)"
done
for path in scenes/vi_a_resolution/*.yaml; do
    run "vi_a_resolution/$(basename "$path" .yaml)" --frames 40
done
cd "$RUNS"
vbaa-bench table */ --format csv > "$OUT/scores.csv"
vbaa-bench table */ --brief > "$OUT/scores.md"
vbaa-bench table fig11_stiffness --by k_s_over_k_beam --format csv > "$OUT/fig11_by_stiffness.csv"
