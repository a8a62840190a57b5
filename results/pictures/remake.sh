# One frame of every scene, the lights, the rig from outside, and of the protocol
# a hung weight and the limits.
python -m results.pictures scenes --out "$OUT/scenes.png"
python -m results.pictures lights --out "$OUT/lighting.png"
python -m results.pictures outside scenes/looks/laboratory.yaml --frame 17 --out "$OUT/outside_view.png"
vbaa-bench view results/pictures/hung_weight.yaml --out "$OUT/hung_weight.png"
vbaa-bench limits results/pictures/protocol.yaml --contact-distance-pct 35,50,65,80 --deflection-pct 5,10 \
    --vary tolerances.flexural_rigidity_pct+tolerances.aspect_ratio_pct=6+2,0.5+0 \
    --out "$RUNS/protocol.html" --csv "$OUT/protocol_limits.csv"
