"""Tests of vbaa_bench/benchmarks/fuzz."""
