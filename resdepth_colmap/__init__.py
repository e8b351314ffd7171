"""Refine the depth maps of a COLMAP workspace, on any machine.

The names below are the library; each is imported when it is first asked for, so that
`import resdepth_colmap` is instant and needs neither torch nor open3d.
"""

import importlib
import zlib as _zlib  # noqa: F401  pycolmap before zlib corrupts it: see io/png.py
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from resdepth_colmap.config import (
        FuseConfig,
        MaskConfig,
        RefineConfig,
        StereoConfig,
    )
    from resdepth_colmap.errors import ResDepthError
    from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
    from resdepth_colmap.network.weights import load_weights
    from resdepth_colmap.pipeline.fuse.stage import fuse_workspace
    from resdepth_colmap.pipeline.refine.cross_view import SourceMap
    from resdepth_colmap.pipeline.refine.stage import refine_workspace
    from resdepth_colmap.pipeline.refine.view import SourceView, ViewInputs, refine_view
    from resdepth_colmap.pipeline.run import run_refine
    from resdepth_colmap.pipeline.run_config import RunConfig
    from resdepth_colmap.report.refine_and_report import refine_and_report
    from resdepth_colmap.scene import Camera, Scene, View

    __version__: str

__all__ = [
    "Camera",
    "FuseConfig",
    "MaskConfig",
    "RefineConfig",
    "ResDepthError",
    "RunConfig",
    "Scene",
    "SourceMap",
    "SourceView",
    "StereoConfig",
    "View",
    "ViewInputs",
    "Workspace",
    "fuse_workspace",
    "load_weights",
    "open_workspace",
    "refine_and_report",
    "refine_view",
    "refine_workspace",
    "run_refine",
]

_MODULE_OF = {
    "Camera": "scene",
    "FuseConfig": "config",
    "MaskConfig": "config",
    "RefineConfig": "config",
    "ResDepthError": "errors",
    "RunConfig": "pipeline.run_config",
    "Scene": "scene",
    "SourceMap": "pipeline.refine.cross_view",
    "SourceView": "pipeline.refine.view",
    "StereoConfig": "config",
    "View": "scene",
    "ViewInputs": "pipeline.refine.view",
    "Workspace": "io.colmap.workspace",
    "fuse_workspace": "pipeline.fuse.stage",
    "load_weights": "network.weights",
    "open_workspace": "io.colmap.workspace",
    "refine_and_report": "report.refine_and_report",
    "refine_view": "pipeline.refine.view",
    "refine_workspace": "pipeline.refine.stage",
    "run_refine": "pipeline.run",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("resdepth-colmap")
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}.")
    module = importlib.import_module(f"{__name__}.{_MODULE_OF[name]}")
    # A module may bear the name of what it holds: the package's attribute is the name.
    globals()[name] = getattr(module, name)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
