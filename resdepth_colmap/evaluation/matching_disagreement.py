"""Why our maps of `meeting_room` differ from COLMAP's where these are confirmed.

Pixels that another map of COLMAP confirms are parted into those where ours agrees and
those where it does not, and both are asked the same: how well COLMAP's map is confirmed
there, what the photographs and the sparse points say of either depth, how alike its
neighbours are. No truth is known of this scene.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.evaluation.map_agreement import (
    Pixels,
    ViewMap,
    mean_of,
    num_confirming,
)
from resdepth_colmap.evaluation.matching_meeting_room import (
    CONFIRMED_WITHIN,
    Room,
    matched_photos,
    matched_room,
)
from resdepth_colmap.evaluation.matching_more_sources import MORE_SOURCES
from resdepth_colmap.evaluation.matching_passes import Folders, Result, depth_of
from resdepth_colmap.evaluation.matching_surroundings import (
    is_like_median,
    likeness,
    near_steps,
    textures,
)
from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import back_project, project, transform
from resdepth_colmap.io.images import read_gray
from resdepth_colmap.io.normal_map import read_normal_map
from resdepth_colmap.io.sparse_points import SparsePoints, read_sparse_points
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.pipeline import stereo_plan
from resdepth_colmap.scene import DepthMap, GrayImage, NormalMap, View, cam_from_cam

AGREES_WITHIN = 0.02
POINT_WITHIN = 0.01
MARGIN = 0.05
"""Difference of two costs, in 0..2, that says which depth matches better."""

NUM_ASKED = 1000
"""Pixels of an image whose costs are looked at, by chance."""


class Compared(NamedTuple):
    """An image with both maps.

    Attributes:
        view: Its view.
        gray: Its photograph.
        theirs: COLMAP's depth; 0 = none.
        ours: Our depth, unfiltered.
        normals: Our normals.
        counts: How many other maps of COLMAP confirm theirs.
        agree: Where they do, and ours agrees.
        disagree: Where they do, and ours does not.
    """

    view: View
    gray: GrayImage
    theirs: DepthMap
    ours: DepthMap
    normals: NormalMap
    counts: npt.NDArray[np.int64]
    agree: Pixels
    disagree: Pixels


def measure_disagreement(folders: Folders) -> Result:
    """What is said of each image, and the means."""
    room = matched_room(folders)
    points = read_sparse_points(room.colmap.sparse_path)
    maps: Result = {}
    for name in room.theirs:
        image = compared_image(room, name)
        maps[name] = {
            "by_count": by_count(image),
            "alike": alike_shares(image),
            "groups": groups_of(room, image),
            "costs": costs_of(room, image) if image.disagree.any() else {},
            "points": points_at(image, points),
        }
    mean = {
        "by_count": _means([entry["by_count"] for entry in maps.values()]),
        "alike": mean_of([entry["alike"] for entry in maps.values()]),
        "groups": _means([entry["groups"] for entry in maps.values()]),
        "costs": _means([entry["costs"] for entry in maps.values()]),
    }
    said = {"num_asked": NUM_ASKED, "margin": MARGIN, "matched": matched_photos(room)}
    return {**said, "maps": maps, "mean": mean}


def _means(entries: Sequence[Result]) -> Result:
    """Of each group the means over the images that have it."""
    labels = {label: None for entry in entries for label in entry}
    return {
        label: mean_of([entry[label] for entry in entries if label in entry])
        for label in labels
    }


def compared_image(room: Room, name: str) -> Compared:
    """Read both maps of an image, and part its pixels."""
    workspace, kind = room.matched.workspace, room.last_kind(name)
    theirs, ours = room.theirs[name], depth_of(workspace, name, kind)
    counts = room.counts(name)
    near = np.abs(ours - theirs.depth) <= AGREES_WITHIN * theirs.depth
    return Compared(
        view=theirs.view,
        gray=read_gray(workspace.image_path(name)),
        theirs=theirs.depth,
        ours=ours,
        normals=read_normal_map(workspace.normal_map_path(name, kind)),
        counts=counts,
        agree=(counts > 0) & near,
        disagree=(counts > 0) & ~near,
    )


def by_count(image: Compared) -> Result:
    """By the number of maps that confirm a pixel: share of pixels, and of agreement."""
    confirmed = image.counts > 0
    found = {}
    for label, where in (
        ("1", image.counts == 1),
        ("2", image.counts == 2),
        ("3 or more", image.counts > 2),
    ):
        found[label] = {
            "share": _share(where, confirmed),
            "agree": _share(image.agree, where),
        }
    return found


def groups_of(room: Room, image: Compared) -> Result:
    """The same questions to the pixels that agree and to those that do not."""
    others = room.others(image.view.name)
    of_ours = num_confirming(
        ViewMap(view=image.view, depth=image.ours), others, CONFIRMED_WITHIN
    )
    alike = likeness(image.theirs)
    steps, texture = near_steps(image.ours), textures(image.gray)
    num_sources = StereoConfig().max_num_sources
    seen = sources_that_see(image, automatic_sources(room, image, num_sources))
    return {
        group: {
            "share": _share(where, image.counts > 0),
            "confirming_theirs": float(image.counts[where].mean()),
            "confirming_ours": float(of_ours[where].mean()),
            "ours_confirmed": _share(of_ours > 0, where),
            "texture": float(np.median(texture[where])),
            "near_step": _share(steps, where),
            "alike": float(alike[where].mean()),
            "seeing": float(seen[where].mean()),
        }
        for group, where in (("agree", image.agree), ("disagree", image.disagree))
        if where.any()
    }


def alike_shares(image: Compared) -> dict[str, float]:
    """What agreement there is where COLMAP's map agrees with itself.

    Returns:
        "of_median": Confirmed pixels where COLMAP's depth is like the median of its own
        window. "where_alike": our agreement where at least half of its window is like
        it, and "alike": how many of the confirmed pixels those are.
    """
    confirmed = image.counts > 0
    is_alike = (likeness(image.theirs) >= 0.5) & confirmed
    return {
        "of_median": _share(is_like_median(image.theirs), confirmed),
        "where_alike": _share(image.agree, is_alike),
        "alike": _share(is_alike, confirmed),
    }


def costs_of(room: Room, image: Compared) -> Result:
    """Where they disagree, which depth the photographs prefer: see `costs_of_both`."""
    from resdepth_colmap.evaluation.matching_evidence import costs_of_both  # numba

    pixels = np.argwhere(image.disagree)[:, ::-1].astype(np.int64)
    pixels = np.random.default_rng(0).permutation(pixels)[:NUM_ASKED]
    x, y = pixels.T
    K = index_K(image.view.camera)
    # The same normals for both: ours, those of either map, and towards the camera.
    normals = [
        image.normals,
        normals_from_depth(image.theirs, K),
        normals_from_depth(image.ours, K),
        np.broadcast_to(np.array([0.0, 0.0, -1.0]), image.normals.shape),
    ]
    return costs_of_both(
        [
            match_view_of(room, view)
            for view in (image.view, *automatic_sources(room, image, MORE_SOURCES))
        ],
        pixels,
        image.ours[y, x].astype(np.float64),
        image.theirs[y, x].astype(np.float64),
        [it[y, x].astype(np.float64) for it in normals],
        MARGIN,
    )


def points_at(image: Compared, points: SparsePoints) -> dict[str, int]:
    """Of the sparse points where maps disagree: how many either runs through."""
    places = points.seen_by(image.view.image_id)
    xyz = transform(image.view.cam_from_world, points.xyz[places])
    xy, z = project(xyz, index_K(image.view.camera))
    height_px, width_px = image.ours.shape
    x, y = np.rint(xy.clip(-1e6, 1e6)).astype(np.int64).T
    inside = (z > 0) & (x >= 0) & (x < width_px) & (y >= 0) & (y < height_px)
    x, y, z = x[inside], y[inside], z[inside]
    there = image.disagree[y, x]
    x, y, z = x[there], y[there], z[there]
    near = {
        label: int((np.abs(depth[y, x] - z) <= POINT_WITHIN * z).sum())
        for label, depth in (("ours", image.ours), ("theirs", image.theirs))
    }
    return {"points": len(z), **near}


def sources_that_see(image: Compared, sources: list[View]) -> npt.NDArray[np.int64]:
    """In how many photographs COLMAP's point lies, occluded or not, (H, W)."""
    found = np.zeros(image.theirs.shape, np.int64)
    where = image.counts > 0
    points = back_project(image.theirs, index_K(image.view.camera))[where]
    for source in sources:
        xyz = transform(cam_from_cam(source, image.view), points)
        xy, z = project(xyz, index_K(source.camera))
        size = (source.camera.width_px - 1, source.camera.height_px - 1)
        found[where] += (z > 0) & (xy >= 0).all(axis=1) & (xy <= size).all(axis=1)
    return found


def automatic_sources(room: Room, image: Compared, number: int) -> list[View]:
    """The view's sources as they are chosen by default, the best ones first."""
    scene = room.matched.scene
    place = scene.index(image.view.name)
    chosen = stereo_plan.automatic_sources(scene, place, number, StereoConfig())
    return [scene.views[index] for index in chosen]


def match_view_of(room: Room, view: View) -> MatchView:
    """A view as the matcher takes it."""
    return MatchView(
        gray=read_gray(room.colmap.image_path(view.name)),
        K=index_K(view.camera),
        cam_from_world=view.cam_from_world,
    )


def _share(where: Pixels, among: Pixels) -> float:
    """How many of those are these, in 0..1; 0 of none."""
    return float(where[among].mean()) if among.any() else 0.0
