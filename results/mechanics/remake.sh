# Equilibria per second on one core, and their errors.
python -m results.mechanics --json > "$OUT/mechanics.json"
