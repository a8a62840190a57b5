# A beam that does not touch yet, and the first degree after contact.
vbaa-bench generate scenes/free_beam.yaml --out "$RUNS/before" --set "pushes.pushing_angle_deg=[-3,-1,-0.3,0]" \
    --set pushes.repeats=375
vbaa-bench generate scenes/free_beam.yaml --out "$RUNS/after" --set "pushes.pushing_angle_deg=[0.03,0.1,0.3,1]" \
    --set pushes.repeats=60
for part in before after; do
    vbaa-bench solve "$RUNS/$part" --method exact_fit --repeats 1
    vbaa-bench score "$RUNS/$part"
    cp "$RUNS/$part/scores/summary.json" "$OUT/$part.json"
done
python - "$RUNS/after/scores/scores.parquet" "$OUT/after.csv" <<'END'
import sys
import polars as pl
columns = ("pushing_angle_deg", "contact_distance_at_rest_mm", "snr", "outcome", "x_c_error_pct_L", "x_c_error_in_sigmas")
pl.read_parquet(sys.argv[1], columns=columns).sort("snr").write_csv(sys.argv[2], float_precision=5)
END
