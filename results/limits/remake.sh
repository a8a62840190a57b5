# The maps, and closed-form limits against re-rendered images.
OF="scenes/fig8_rigid.yaml --require x_c_pct_L=0.1,force_mn=1"
# shellcheck disable=SC2086
vbaa-bench limits $OF --contact-distance-pct 10,20,30,40,50,60,70,80,90,95 --deflection-pct 1,2,3,5,10,20,30 \
    --out "$OUT/fig8_rigid.html"
# shellcheck disable=SC2086
vbaa-bench limits $OF --vary beam.diameter_mm=0.4,0.8,1.6 \
    --vary camera.width_px+camera.height_px+camera.focal_length_px=256+256+350,512+512+700,1024+1024+1400 \
    --out "$OUT/designs.html"
# shellcheck disable=SC2086
vbaa-bench limits $OF --vary 'camera.position_mm=[120,18,360],[120,-162,312],[-60,18,312],[300,18,312]' \
    --out "$OUT/viewpoints.html"
# shellcheck disable=SC2086
vbaa-bench limits $OF --vary tolerances.flexural_rigidity_pct=1,0.3,0.1 --out "$OUT/rigidity.html"
python -m results.limits scenes/fig8_rigid.yaml scenes/fig9_knife_edge.yaml scenes/fig6_unknown_psi.yaml \
    scenes/fig11_stiffness.yaml scenes/fig13_occlusion.yaml --frames 3 --exposures 2000 --out "$OUT/rendered.md"
