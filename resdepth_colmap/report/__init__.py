"""The report of a refinement: one HTML file that works offline."""
