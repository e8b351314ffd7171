"""What measures resdepth-colmap for docs/benchmarks.md."""
