"""Laws of the threads that the matcher's kernels run on."""

import subprocess
import sys


def test_the_old_tbb_of_open3d_is_nothing_to_warn_of() -> None:
    code = """
import warnings
import open3d
import numba
import numpy as np
from numba.core.errors import NumbaWarning
import resdepth_colmap.matching.sweeps

warnings.simplefilter("error", NumbaWarning)

@numba.njit(parallel=True)
def doubled(values):
    for index in numba.prange(values.size):
        values[index] *= 2.0

values = np.ones(100)
doubled(values)
assert (values == 2.0).all()
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
