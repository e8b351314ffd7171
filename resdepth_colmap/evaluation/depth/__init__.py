"""`evaluate depth` and `evaluate eth3d`: depth maps against the truth."""
