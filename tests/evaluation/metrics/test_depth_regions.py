"""Laws of telling edges from flat areas."""

import numpy as np

from resdepth_colmap.evaluation.metrics.depth_metrics import EDGE_RADIUS_PX, edge_region


def test_an_edge_is_as_wide_as_its_radius_on_both_sides() -> None:
    truth = np.full((20, 40), 2, np.float32)
    truth[:, 20:] = 3
    edge = edge_region(truth)
    columns = np.flatnonzero(edge.all(axis=0))
    assert columns.tolist() == list(range(20 - EDGE_RADIUS_PX, 20 + EDGE_RADIUS_PX))
    assert edge.sum() == 20 * len(columns)


def test_holes_are_no_edges_and_hide_none() -> None:
    truth = np.full((20, 40), 2, np.float32)
    truth[:, 20:] = 3
    truth[:, 19:21] = 0
    edge = edge_region(truth)
    assert not edge[:, 19:21].any()
    assert edge[:, 18].all() and edge[:, 21].all()
    assert not edge_region(np.where(truth == 3, 0, truth)).any()


def test_a_floor_seen_at_a_grazing_angle_is_flat() -> None:
    rows = np.arange(1, 61, dtype=np.float32)[:, None] + 40
    truth = np.broadcast_to(300 / rows, (60, 30))  # 1 % to 2.4 % from row to row
    assert not edge_region(np.ascontiguousarray(truth[50:])).any()


def test_nothing_known_has_no_edge() -> None:
    assert not edge_region(np.zeros((5, 5), np.float32)).any()
