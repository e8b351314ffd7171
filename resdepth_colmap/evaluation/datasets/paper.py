"""Protocol and figures of the paper on ETH3D (Stucker and Schindler, CVPRW 2020).

Section "ETH3D" and table "Quantitative results on ETH3D indoor scenes".
"""

from typing import NamedTuple

PAPER_MAX_RESIDUAL = 10.0
"""Larger residuals, in metres, are discarded before computing statistics."""

PAPER_IMAGE_WIDTH_PX = 886
"""Images are resized to 886 x 590 pixels."""


class PaperRow(NamedTuple):
    """A row of the table: errors in metres of ResDepth-stereo and unfiltered COLMAP.

    The pairs were picked by hand and not published.
    """

    num_pairs: int
    refined_mae: float
    refined_rmse: float
    unfiltered_mae: float
    unfiltered_rmse: float


PAPER_ROWS = {
    "delivery_area": PaperRow(4, 0.21, 0.75, 0.24, 0.94),
    "kicker": PaperRow(4, 0.16, 0.42, 0.41, 1.11),
    "office": PaperRow(3, 0.13, 0.22, 0.55, 1.21),
    "pipes": PaperRow(3, 0.19, 0.60, 0.45, 1.30),
    "relief": PaperRow(4, 0.18, 0.85, 0.28, 1.11),
    "relief_2": PaperRow(4, 0.12, 0.57, 0.17, 0.82),
    "terrains": PaperRow(4, 0.07, 0.20, 0.45, 1.42),
}
"""The rows by the name of the scene's folder."""

PAPER_OVERALL = PaperRow(26, 0.15, 0.57, 0.35, 1.13)
"""The last row. Its RMSE is over all pixels, not the mean over the scenes."""
