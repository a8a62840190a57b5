python -m results.outline scenes/explore/outline.yaml scenes/explore/outline_hexagon.yaml \
    scenes/explore/outline_plectrum.yaml --out "$OUT"
