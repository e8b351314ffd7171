"""Point clouds against laser scans and reference clouds."""
