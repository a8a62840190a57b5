python results/debug_run/measure.py --again
cp results/debug_run/debug_run.csv "$OUT/"
