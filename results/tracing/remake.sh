# DATASET is the folder dataset/ of a copy of https://github.com/StructuresComp/mBEST
python -m results.tracing "$DATASET" --odd > "$OUT/odd.md"
