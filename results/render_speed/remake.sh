vbaa-bench speed render scenes/fig8_rigid.yaml --seconds 1200 --out "$OUT"
