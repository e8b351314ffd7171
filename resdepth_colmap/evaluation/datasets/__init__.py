"""Samples with known depth: Middlebury, ETH3D, workspaces with `ground_truth/`."""
