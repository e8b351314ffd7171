"""The table of the failing cases of real users."""

from collections.abc import Iterator

from resdepth_colmap.evaluation.markdown import Measured, columns

BEFORE = {
    "blank_maps": "an error without a way out",
    "geo_cloud_float32": "coordinates in steps of 3 to 50 cm",
    "maps_of_other_scale": "taken with confidence 1.00",
    "mask_refilled": "masked areas filled, 58 % black points",
    "new_images_skipped": "skipped, exit code 0",
    "stale_after_model_change": "kept, 99.7 % of pixels off by > 1 %",
    "turntable_floaters": "54 % of the points float",
}
"""What they said on 2026-11-27, of version 0.1.0."""

CASES = columns("", {"case": "case", "before": "0.1.0", "said": "now"})


def case_rows(measured: Measured) -> Iterator[dict[str, str]]:
    """The cases, with what they said before."""
    for name, case in measured["cases"].items():
        before = BEFORE.get(name, "")
        yield {"case": f"`{name}`", "before": before, "said": case["said"]}
