# One frame of every scene, the lights, and the rig from outside.
python -m results.pictures scenes --out "$OUT/scenes.png"
python -m results.pictures lights --out "$OUT/lighting.png"
python -m results.pictures outside scenes/looks/laboratory.yaml --frame 17 --out "$OUT/outside_view.png"
