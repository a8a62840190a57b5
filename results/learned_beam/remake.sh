# The first table of the page. Of random/hard it has 40 rigs: 300 take four hours.
P="pushes.contact_distance_mm=[65,95,125,155,185,210]"
W="--seed 2713 --set beam.density_kg_m3=1600 --set gravity_m_s2=[0,9.81,0] --set tolerances.gravity_deg=0.1"
vbaa-bench generate scenes/hard/taper.yaml --out "$RUNS/taper" --seed 2701 --set "$P" --set pushes.repeats=6
vbaa-bench generate scenes/hard/stretch.yaml --out "$RUNS/stretch" --seed 2702 --set "$P" --set pushes.repeats=6
vbaa-bench generate scenes/hard/friction.yaml --out "$RUNS/friction" --seed 2704 \
    --set "pushes.contact_distance_mm=[70,110,150,195]" --set pushes.repeats=4
for seed in 2705 2706 2707 2708; do
    vbaa-bench generate scenes/hard/real_wire.yaml --out "$RUNS/real_wire_$seed" --seed "$seed"
done
# shellcheck disable=SC2086
vbaa-bench generate scenes/hard/elliptic.yaml --out "$RUNS/elliptic" $W --set "$P" --set pushes.repeats=6
# shellcheck disable=SC2086
vbaa-bench generate scenes/hard/elliptic.yaml --out "$RUNS/elliptic_weight" $W \
    --set "object={kind: weight, weight_g: 4, thread_length_mm: 15, weight_diameter_mm: 8, weight_height_mm: 10, reflectance: 0.3}" \
    --set "pushes={contact_distance_mm: [140, 190], pushing_angle_deg: [0], repeats: 2}"
vbaa-bench generate scenes/random/hard.yaml --seed 20411 --rigs 0:40 --out "$RUNS/random_hard"
# As a rig.json without beam_shape.
U="--set tolerances.tip_ratio_pct=2 --set tolerances.aspect_ratio_pct=2 --set tolerances.friction=0.2"
for seed in 2715 2716; do
    # shellcheck disable=SC2086
    vbaa-bench generate scenes/quickstart.yaml --out "$RUNS/unknown_$seed" --seed "$seed" --set "$P" --set pushes.repeats=4 \
        $U --set tolerances.clamp_softness=0.002
done
for dataset in unknown_2715 unknown_2716 taper stretch friction elliptic real_wire_2705 real_wire_2706 real_wire_2707 real_wire_2708; do
    vbaa-bench limits "$RUNS/$dataset"
done
cd "$RUNS"
python -m results.learned_beam taper stretch --seed 2 --out "$OUT/taper_stretch.md"
python -m results.learned_beam taper --pushes 10 --seed 2 --out "$OUT/taper_10_pushes.md"
python -m results.learned_beam unknown_2715 unknown_2716 --pushes 10 --seed 2 --out "$OUT/unknown.md"
python -m results.learned_beam friction --pushes 4 --seed 2 --out "$OUT/friction.md"
python -m results.learned_beam elliptic --seed 2 --force-sigma-pct 0.1 --weights elliptic_weight --out "$OUT/elliptic.md"
python -m results.learned_beam real_wire_2705 real_wire_2706 real_wire_2707 real_wire_2708 --out "$OUT/real_wire.md"
python -m results.learned_beam random_hard --seed 2 --out "$OUT/random_hard.md"
