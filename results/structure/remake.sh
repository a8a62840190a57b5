# Size and structure of the working copy.
python -m results.structure --json > "$OUT/structure.json"
