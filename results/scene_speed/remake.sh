python -m results.scene_speed scenes --limit 60 --out "$OUT"
