"""Views of which the best ones by themselves do not see all that a view sees."""

import numpy as np
from analytic_scene import CAMERA, turned, view_at

from resdepth_colmap.scene import Scene


def lookers() -> Scene:
    """The first looks ahead; three beside it look left and share more, two right."""
    left, right = turned(0.0, -0.6), turned(0.0, 0.6)
    poses = [turned(0.0, 0.0), left, left, left, right, right]
    heights = (0.0, 0.4, 0.5, 0.6, 0.7, 0.8)
    views = [
        view_at((0.0, height, 0.0), CAMERA, pose)
        for height, pose in zip(heights, poses, strict=True)
    ]
    num_shared, angle = np.zeros((6, 6), dtype=np.int64), np.zeros((6, 6))
    num_shared[0] = num_shared[:, 0] = [0, 90, 80, 70, 40, 30]
    angle[0] = angle[:, 0] = 6.0
    return Scene(
        views=tuple(views),
        num_points=100,
        num_shared_points=num_shared,
        triangulation_angle_deg=angle,
        depth_range=np.tile([2.0, 6.0], (6, 1)),
    )
