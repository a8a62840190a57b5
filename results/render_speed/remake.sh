python -m results.render_speed scenes/fig8_rigid.yaml --seconds 1200 --out "$OUT"
