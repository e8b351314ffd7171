"""The residual U-Net and its weights."""
