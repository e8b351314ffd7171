"""Samples with ground truth: Middlebury, ETH3D, workspaces with `ground_truth/`."""
