# Every row, on the 30 rigs of the README's table.
set +e # a target that is missed, exit status 1, is a result
vbaa-bench stress scenes/quickstart.yaml --rigs 30 --frames 10 --seed 3033 --work "$RUNS" --json > "$OUT/stress.json"
set -e
test -s "$OUT/stress.json"
