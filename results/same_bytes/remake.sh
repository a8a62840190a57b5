python results/same_bytes/measure.py --again
cp results/same_bytes/same_bytes.csv "$OUT/"
