"""The commands `evaluate depth` and `evaluate eth3d`: depth against ground truth."""
