# The datasets whose frames were frozen:  sh tests/frozen/datasets.sh FOLDER
# Each push of a grid once; two pushes of each of forty random rigs of a kind.
set -e
for scene in fig8_rigid fig6_unknown_psi fig14_micro va_flat_strip $(cd scenes && ls hard/*.yaml | sed 's/.yaml$//'); do
    repeats=1
    if [ "$scene" = hard/hung_weight ]; then repeats=12; fi
    vbaa-bench generate "$scene" --set pushes.repeats=$repeats --out "$1/$(echo "$scene" | tr / _)"
done
for kind in rigs looks hard; do
    vbaa-bench generate random/$kind --rigs 0:40 --set pushes.draws=2 --out "$1/random_$kind" || true
done
