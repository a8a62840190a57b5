python -m results.photographs --rigs 12 --seed 1 --out "$OUT"
