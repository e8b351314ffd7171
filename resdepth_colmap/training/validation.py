"""How good the network is on views that it is not trained on."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.io.images import read_rgb
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.refine.view import refine_view
from resdepth_colmap.scene import DepthMap
from resdepth_colmap.training.data.batches import CropSet
from resdepth_colmap.training.data.labelled_views import (
    LabelledView,
    labelled_views,
    load_views,
)
from resdepth_colmap.training.loss import refinement_loss
from resdepth_colmap.viz.strips import BeforeAfter

NUM_BATCHES = 8
NUM_PICTURES = 2

# The network by itself: no rule after it hides what it does to good pixels.
_REFINING = RefineConfig(inner_iterations=1, update_gating=False)
_OFF = 0.02


class Scores(NamedTuple):
    """Errors of refined depth over those of the initial one: means over the views.

    Only pixels with both an initial and a true depth count.

    Attributes:
        mae_ratio: Of the mean absolute error.
        medae_ratio: Of the median absolute error.
        off_ratio: Of the share of pixels that are off by more than 2 %.
    """

    mae_ratio: float
    medae_ratio: float
    off_ratio: float

    @property
    def score(self) -> float:
        """What the best weights have least of: outliers and harm in equal parts.

        A ratio that is not known (there was no error before) is left out.
        """
        return _mean([self.mae_ratio, self.medae_ratio])


@dataclasses.dataclass(frozen=True, kw_only=True)
class ValidationSet:
    """Views to refine again and again.

    Attributes:
        name: "held_out" or "watched".
        views: The views.
    """

    name: str
    views: tuple[LabelledView, ...]

    @classmethod
    def of(cls, name: str, scenes: Sequence[Path], most: int) -> "ValidationSet":
        """At most so many views, spread evenly over the scenes.

        Raises:
            WorkspaceError: If a workspace is broken, or cannot be matched.
        """
        views = [view for path in scenes for view in labelled_views(path)]
        places = np.linspace(0, len(views) - 1, min(most, len(views)))
        chosen = tuple(views[place] for place in places.round().astype(int))
        return cls(name=name, views=chosen)

    def measure(self, network: ResDepthNet) -> tuple[Scores, list[BeforeAfter]]:
        """Refine the views; their scores, and some of them to look at."""
        ratios: list[list[float]] = []
        pictures: list[BeforeAfter] = []
        for view, initial, refined, truth in self._refined(network):
            known = (truth > 0) & (initial > 0)
            ratios.append(_ratios(initial[known], refined[known], truth[known]))
            if len(pictures) < NUM_PICTURES:
                rgb = read_rgb(view.workspace.image_path(view.image_name))
                pictures.append(
                    BeforeAfter(
                        name=view.name,
                        rgb=rgb,
                        before=initial,
                        after=refined,
                        truth=truth,
                    )
                )
        means = [_mean([values[place] for values in ratios]) for place in range(3)]
        return Scores(*means), pictures

    def _refined(
        self, network: ResDepthNet
    ) -> Iterator[tuple[LabelledView, DepthMap, DepthMap, DepthMap]]:
        for view, loaded in load_views(self.views, network.config.num_sources):
            refined = refine_view(loaded.inputs, network, _REFINING).depth
            yield view, loaded.inputs.depth, refined, loaded.truth


@torch.inference_mode()
def mean_loss(network: ResDepthNet, crops: CropSet) -> float:
    """The loss over the same few batches each time."""
    network.eval()
    device = next(network.parameters()).device
    total, num_known = 0.0, 0.0
    for batch in crops.batches(range(NUM_BATCHES)):
        batch = batch.to(device)
        refined = network(batch.inputs, batch.sample_source)
        loss = refinement_loss(refined, batch, crops.config)
        total += float(loss.total)
        num_known += float(loss.num_known)
    return total / max(num_known, 1.0)


def _ratios(initial: DepthMap, refined: DepthMap, truth: DepthMap) -> list[float]:
    before, after = np.abs(initial - truth), np.abs(refined - truth)
    return [
        _ratio(float(after.mean()), float(before.mean())),
        _ratio(float(np.median(after)), float(np.median(before))),
        _ratio(
            float((after > _OFF * truth).mean()), float((before > _OFF * truth).mean())
        ),
    ]


def _ratio(after: float, before: float) -> float:
    """NaN where there was no error: no ratio says how much worse it got."""
    return after / before if before else math.nan


def _mean(values: Sequence[float]) -> float:
    """The mean of those that are known; NaN if none is."""
    there = [value for value in values if math.isfinite(value)]
    return sum(there) / len(there) if there else math.nan
