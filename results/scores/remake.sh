# All methods on the suite's fixed scenes, with their ranks, and on the paper's other scenes, beside the limits.
# It takes about two hours on two cores: with the same --work, a second call goes on where the time limit has ended the first one.
suite=$RUNS/suite_1.0 others=$RUNS/others
for scene in fig2_sliding_edge fig5_line_contact camera_fixed camera_moving linear_beam va_flat_strip \
    vi_a_resolution/{beam_0.4mm,beam_1.6mm,image_256px,image_1024px,wide_view,tip_out_of_view}; do
    vbaa-bench run "scenes/$scene.yaml" --out "$others/$(basename "$scene")" --frames 40
done
vbaa-bench suite run 1.0 --track paper --track hard --track cameras --out "$suite"
vbaa-bench suite leaderboard "$suite"
cp "$suite"/leaderboard.{csv,html} "$OUT"
vbaa-bench table "$suite"/tracks/*/* "$others"/* --brief > "$OUT/scores.md"
vbaa-bench table "$suite"/tracks/*/* "$others"/* --format csv > "$OUT/scores.csv"
vbaa-bench table "$suite/tracks/paper/fig11" --by k_s_over_k_beam --format csv > "$OUT/fig11_by_stiffness.csv"
