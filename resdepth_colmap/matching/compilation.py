"""How numba compiles the kernels and runs their threads."""

import contextlib
from pathlib import Path


def forget_stale_kernels(folder: Path) -> None:
    """Forget the compiled kernels of a folder if any of its sources is newer.

    numba looks at the file of a kernel alone, not at those of the kernels and constants
    that are compiled into it: after a change there it would go on with the old code.

    Args:
        folder: Of the Python files; numba's index files are in its `__pycache__`.
    """
    newest = max(path.stat().st_mtime_ns for path in folder.glob("*.py"))
    for index in (folder / "__pycache__").glob("*.nbi"):
        # Another process may do the same, or the folder may not be ours to write.
        with contextlib.suppress(OSError):
            if index.stat().st_mtime_ns < newest:
                index.unlink()


def choose_threading_layer() -> None:
    """Let numba try OpenMP first; otherwise it tries TBB, and warns of an old one.

    A module with parallel kernels calls this before it defines them.
    """
    import numba  # slow import

    numba.config.THREADING_LAYER_PRIORITY = [  # type: ignore[attr-defined] # at run time
        "omp",
        "tbb",
        "workqueue",
    ]
