# Every row, on the 30 rigs of the README's table. A target that is missed (exit status 1) is a result.
vbaa-bench stress scenes/quickstart.yaml --rigs 30 --frames 10 --seed 3033 --work "$RUNS" --json \
    > "$OUT/stress.json" || [ "$?" -eq 1 ]
