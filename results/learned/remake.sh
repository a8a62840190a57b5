# Needs the extra 'learned'.
for scene in train_2d_one_look train_2d; do
    vbaa-bench generate "scenes/$scene.yaml" --frames 300 --out "$RUNS/$scene"
    vbaa-bench solve "$RUNS/$scene" --method exact_fit
done
cd "$RUNS"
python -m results.learned train_2d_one_look train_2d --out "$OUT/trained_on_train_2d_one_look.md"
python -m results.learned train_2d train_2d_one_look --out "$OUT/trained_on_train_2d.md"
