"""Laws of the edges that follow the photo's."""

import dataclasses

import numpy as np
import torch
from refined_plane import TILES, network

from resdepth_colmap.pipeline.inputs import ViewTensors
from resdepth_colmap.pipeline.photo_edges import follow_edges
from resdepth_colmap.pipeline.refine import ViewInputs, refine_view

EDGE_PX, FAT_PX, SIZE = 32, 3, (48, 64)
FOLLOWING = dataclasses.replace(TILES, follow_edges=True)


def step(at_px: int, left: float, right: float) -> np.ndarray:
    columns = np.broadcast_to(np.arange(SIZE[1]), SIZE)
    return np.where(columns < at_px, left, right).astype(np.float32)


def test_a_fattened_thing_gets_the_outline_that_it_has_in_the_photo() -> None:
    """Fattened as the windows of a matcher do it; the network changes nothing."""
    true, fat = step(EDGE_PX, 2.0, 5.0), step(EDGE_PX + FAT_PX, 2.0, 5.0)
    hue = np.stack([step(EDGE_PX, 0.9, 0.1), step(EDGE_PX, 0.3, 0.5)] * 2, axis=2)
    K = np.array([[50.0, 0, 32], [0, 50, 24], [0, 0, 1]])
    by_gray = ViewInputs(depth=fat, gray=step(EDGE_PX, 0.8, 0.2), K=K)
    flat = np.full(SIZE, 0.5, np.float32)
    by_color = ViewInputs(depth=fat, gray=flat, K=K, colors=hue[..., :3])
    net = network(confidence=False)
    for view in (by_gray, by_color):
        refined = refine_view(view, net, FOLLOWING).depth
        np.testing.assert_allclose(refined, true, rtol=1e-6)
        as_it_was = refine_view(view, net, TILES).depth
        np.testing.assert_allclose(as_it_was, fat, rtol=1e-6)


def test_what_the_network_is_unsure_of_gives_way() -> None:
    inverse_depth = torch.full((1, 1, *SIZE), 0.5)
    inverse_depth[..., 14:32, 22:40] = 0.2
    gray = torch.full_like(inverse_depth, 0.5)
    tensors = ViewTensors(
        inverse_depth, inverse_depth > 0, gray, torch.eye(3)[None], ()
    )
    sure = torch.full_like(inverse_depth, 1e-4)
    unsure = torch.where(inverse_depth < 0.5, 0.5, 1e-4)
    centre = (..., slice(23, 24), slice(31, 32))
    for error, expected in ((None, 0.2), (sure, 0.2), (unsure, 0.5)):
        followed = follow_edges(inverse_depth, error, tensors)
        assert followed.shape == inverse_depth.shape
        torch.testing.assert_close(
            followed[centre], torch.full_like(followed[centre], expected)
        )
