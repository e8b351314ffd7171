"""The CPU PatchMatch."""

from pathlib import Path

from resdepth_colmap.matching.compilation import forget_stale_kernels

forget_stale_kernels(Path(__file__).parent)
