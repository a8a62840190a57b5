vbaa-bench speed scenes scenes --limit 60 --out "$OUT"
