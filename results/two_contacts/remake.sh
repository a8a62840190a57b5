vbaa-bench generate results/two_contacts/drawn.yaml --out "$RUNS/drawn"
vbaa-bench generate results/two_contacts/drawn.yaml --seed 41001 --out "$RUNS/tapered" --set pushes.repeats=10 \
    --set beam.tip_ratio=0.8 --set tolerances.tip_ratio_pct=20
vbaa-bench generate scenes/hard/two_pegs.yaml --seed 41002 --out "$RUNS/far" --set second_peg.distance_mm=215 \
    --set second_peg.gap_mm=0.5 --set "pushes.contact_distance_mm=[70,90,110]" \
    --set "pushes.pushing_angle_deg=[4,6,8,10]"
vbaa-bench generate scenes/hard/two_pegs.yaml --out "$RUNS/two_pegs"
cd "$RUNS"
for dataset in drawn two_pegs tapered far; do
    vbaa-bench limits "$dataset"
    vbaa-bench solve "$dataset" --method exact_fit --method two_contact_fit
    vbaa-bench score "$dataset"
done
vbaa-bench table drawn two_pegs tapered far --format csv > "$OUT/scores.csv"
vbaa-bench table drawn --by pushing_angle_deg --format csv > "$OUT/drawn_by_pushing_angle.csv"
