vbaa-bench check-photographs --rigs 12 --seed 1 --out "$(realpath --relative-to=. "$OUT")"
