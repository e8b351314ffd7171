"""Exact maps of a sphere before a slanted plane, seen by up to five cameras."""

import dataclasses

import numpy as np
from analytic_scene import (
    CAMERA,
    PLANE_NORMAL,
    PLANE_OFFSET,
    SPHERE_CENTER,
    depth_of_plane,
    depth_of_sphere,
    turned,
    view_at,
)

from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.pipeline.fuse.views import FuseView
from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap, Matrix, View

Points = Matrix | FloatMap
PLANE_UNIT_NORMAL = PLANE_NORMAL / np.linalg.norm(PLANE_NORMAL)
PLANE_UNIT_OFFSET = PLANE_OFFSET / float(np.linalg.norm(PLANE_NORMAL))
SPHERE_RADIUS = 0.6
_SPHERE_CENTER = SPHERE_CENTER - np.array([0.0, 0.0, 1.2])
_CENTERS = ((0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (-0.3, 0.1, 0.0), (0.0, 0.3, -0.1))
_TURNS = ((0.0, 0.0), (0.02, -0.08), (-0.01, 0.09), (0.08, 0.01))


def fusion_views(num_views: int = 4) -> list[View]:
    """Cameras beside each other, all turned towards the sphere."""
    return [
        dataclasses.replace(
            view_at(center, CAMERA, turned(*turn).T, f"{index}.png"),
            image_id=index + 1,
        )
        for index, (center, turn) in enumerate(
            zip(_CENTERS[:num_views], _TURNS, strict=False)
        )
    ]


def exact_depth(view: View) -> DepthMap:
    """The nearer of plane and sphere, shape (H, W), in units."""
    plane = depth_of_plane(view, PLANE_NORMAL, PLANE_OFFSET)
    sphere = depth_of_sphere(view, _SPHERE_CENTER, SPHERE_RADIUS)
    return np.asarray(np.where(sphere > 0, sphere, plane), dtype=np.float32)


def fuse_view(view: View) -> FuseView:
    """The exact maps and colours of a view."""
    depth = exact_depth(view)
    xyz = _lifted(view, depth)
    normals = surface_normals(xyz) @ view.cam_from_world[:, :3].T
    return FuseView(
        name=view.name,
        K=index_K(view.camera),
        cam_from_world=view.cam_from_world,
        depth=depth,
        normals=normals.astype(np.float32),
        rgb=surface_colors(xyz),
    )


def fuse_view_list(num_views: int = 4) -> list[FuseView]:
    """The exact maps of the first cameras."""
    return [fuse_view(view) for view in fusion_views(num_views)]


def surface_distance(points: Points) -> FloatMap:
    """Distance to the nearer surface, shape (N,), in units."""
    plane = np.abs(points @ PLANE_UNIT_NORMAL - PLANE_UNIT_OFFSET)
    from_center = np.linalg.norm(points - _SPHERE_CENTER, axis=-1)
    return np.asarray(np.minimum(plane, np.abs(from_center - SPHERE_RADIUS)))


def surface_normals(points: Points) -> Matrix:
    """Unit normals of the nearer surface in the world, towards the cameras."""
    from_center = points - _SPHERE_CENTER
    distance = np.linalg.norm(from_center, axis=-1, keepdims=True)
    on_sphere = np.abs(distance - SPHERE_RADIUS) < 1e-2
    return np.asarray(np.where(on_sphere, from_center / distance, PLANE_UNIT_NORMAL))


def surface_colors(points: Points) -> ColorImage:
    """A smooth colour of each point of the world."""
    waves = 0.5 + 0.5 * np.sin(2 * points + np.array([0.0, 1.0, 2.0]))
    return np.asarray(255 * waves + 0.5).astype(np.uint8)


def _lifted(view: View, depth: DepthMap) -> Matrix:
    K, rotation = index_K(view.camera), view.cam_from_world[:, :3]
    x, y = np.meshgrid(np.arange(depth.shape[1]), np.arange(depth.shape[0]))
    pixels = np.stack([x, y, np.ones_like(x)], axis=-1).astype(np.float64)
    in_cam = pixels @ np.linalg.inv(K).T * depth[..., None]
    return np.asarray(view.center_in_world + in_cam @ rotation)
