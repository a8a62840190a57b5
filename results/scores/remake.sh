# All methods on the suite, with their ranks, and on the paper's other scenes, beside the limits.
# With the same --work, a second call goes on where the time limit has ended the first one.
suite=$RUNS/suite_1.0 others=$RUNS/others
for scene in fig2_sliding_edge fig5_line_contact camera_fixed camera_moving linear_beam va_flat_strip \
    vi_a_resolution/{beam_0.4mm,beam_1.6mm,image_256px,image_1024px,wide_view,tip_out_of_view}; do
    vbaa-bench run "scenes/$scene.yaml" --out "$others/$(basename "$scene")" --frames 40
done
vbaa-bench suite run 1.0 --out "$suite"
vbaa-bench suite leaderboard "$suite"
cp "$suite"/leaderboard.{csv,html} "$OUT"
table() {
    vbaa-bench table "${@:2}" --brief > "$OUT/$1.md"
    vbaa-bench table "${@:2}" --format csv > "$OUT/$1.csv"
}
table scores "$suite"/tracks/{paper,hard,cameras}/* "$others"/*
table random "$suite"/tracks/random/*
vbaa-bench table "$suite/tracks/paper/fig11" --by k_s_over_k_beam --format csv > "$OUT/fig11_by_stiffness.csv"
