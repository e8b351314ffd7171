"""The measures of a comparison, and what each is the mean of."""

MEASURES = {
    "coverage": "share of pixels with a depth",
    "points_even": "sparse points with even ids within 1 % of the map; a hole is not",
    "points_odd": "sparse points with odd ids, the other half",
    "points_even_common": "even ids, where every method has a depth",
    "points_odd_common": "odd ids, where every method has a depth",
    "agreement": "pixels within 1 % of the map of a neighbour that has a depth there",
    "agreement_common": "the same where every method has a depth in both views",
    "consistent": "pixels that the map of at least one neighbour agrees with",
    "photo": "correlation (NCC, 7 x 7) of the image with the warped neighbours",
    "photo_common": "the same where every method has a depth",
    "right_1": "pixels within 1 % of the true depth, where known; a hole is not",
    "right_2": "pixels within 2 % of the true depth, where known; a hole is not",
    "right_1_common": "within 1 % of the true depth, where every method has a depth",
    "right_2_common": "within 2 % of the true depth, where every method has a depth",
}
"""Each is one number per view, and more is better. "common": over the same pixels for
all methods."""
