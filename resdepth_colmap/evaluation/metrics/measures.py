"""What is measured on each view of a comparison, and the words for it."""

MEASURES = {
    "coverage": "share of pixels with a depth",
    "points_even": "sparse points with even ids within 1 % of the map; a hole is not",
    "points_odd": "sparse points with odd ids, the other half",
    "points_even_common": "the same where every arm has a depth: even ids",
    "points_odd_common": "the same where every arm has a depth: odd ids",
    "agreement": "looked up in a neighbour's map that has a depth there: within 1 %",
    "agreement_common": "the same where every arm and its neighbour have a depth",
    "confirmed": "share of all pixels that some neighbour's map agrees with",
    "photo": "correlation (NCC, 7 x 7) of the photo with its re-warped neighbours",
    "photo_common": "the same at the pixels that every arm covers",
    "right_1": "known pixels within 1 % of the true depth; a hole is not",
    "right_2": "known pixels within 2 % of the true depth; a hole is not",
    "right_1_common": "within 1 % of the true depth, where every arm has a depth",
    "right_2_common": "within 2 % of the true depth, where every arm has a depth",
}
"""The measures, and what each is the mean of."""
