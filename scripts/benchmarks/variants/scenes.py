"""Copies of scenes that hold the depth maps which variants are trained on."""

from collections.abc import Sequence
from pathlib import Path

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.files import link_or_copy
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.initial_map import choose_initial_map
from resdepth_colmap.training.data.labelled_views import labelled_views
from resdepth_colmap.training.data.scenes import scene_name
from scripts.benchmarks.matching.matched_workspace import linked_maps, matched_workspace
from scripts.benchmarks.variants.method import Method

REFINED_KIND = "refined"


def lean_copies(scenes: Sequence[Path], folder: Path) -> list[Path]:
    """Workspaces that share all with these, but have one map a view.

    It is the map that a refinement starts from. A scene without maps is matched.
    """
    copies = []
    for scene in scenes:
        copy = matched_workspace(scene, folder / scene_name(scene))
        linked_maps(scene, copy)
        views = labelled_views(copy.path, StereoConfig(filter=False))
        for view in views:
            kinds = [other.kind for other in views if other.index == view.index]
            camera = view.scene.views[view.index].camera
            best = choose_initial_map(view.workspace, view.image_name, camera, kinds)
            if view.kind != best.kind:
                view.map_path.unlink()
        copies.append(copy.path)
    return copies


def refined_copies(
    scenes: Sequence[Path], network: ResDepthNet, folder: Path
) -> list[Path]:
    """Workspaces that share all with these, but whose depth maps are refined."""
    copies = []
    for scene in scenes:
        copy = matched_workspace(scene, folder / scene_name(scene))
        for view in labelled_views(scene):
            path = copy.workspace.depth_map_path(view.image_name, REFINED_KIND)
            loaded = None if path.exists() else view.load(network.config.num_sources)
            if loaded is not None:
                write_depth_map(path, Method([network]).refined(loaded.inputs))
            elif not path.exists():  # of a failed pair: no training takes it
                link_or_copy(view.map_path, path)
        copies.append(copy.path)
    return copies
