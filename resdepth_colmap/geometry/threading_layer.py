"""Which threads numba's parallel kernels run on."""

import numba


def prefer_openmp() -> None:
    """Say it before a kernel runs: else numba tries TBB first, and warns of old ones.

    open3d brings an old one along.
    """
    numba.config.THREADING_LAYER_PRIORITY = [  # type: ignore[attr-defined] # set at run time
        "omp",
        "tbb",
        "workqueue",
    ]
