"""Validation: errors of the network on views that it is not trained on."""

import dataclasses
import math
from collections.abc import Sequence
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

# The network alone: update gating would hide its effect on good pixels.
_REFINING = RefineConfig(inner_iterations=1, update_gating=False)
_OFF = 0.02


class Scores(NamedTuple):
    """Errors of the refined depth over those of the initial depth, means over views.

    Only pixels with both initial and true depth count.

    Attributes:
        mae_ratio: Ratio of the mean absolute errors.
        medae_ratio: Ratio of the median absolute errors.
        off_ratio: Ratio of the shares of pixels that are off by more than 2 %.
    """

    mae_ratio: float
    medae_ratio: float
    off_ratio: float

    @property
    def score(self) -> float:
        """Mean of MAE ratio and MedAE ratio; the best weights have the least.

        An unknown ratio (no error before) is left out.
        """
        return _mean([self.mae_ratio, self.medae_ratio])


@dataclasses.dataclass(frozen=True, kw_only=True)
class ValidationSet:
    """Views to refine in each validation.

    Attributes:
        name: "held_out" or "watched".
        views: The views.
    """

    name: str
    views: tuple[LabelledView, ...]

    @classmethod
    def of(cls, name: str, scenes: Sequence[Path], most: int) -> "ValidationSet":
        """At most `most` views, spread evenly over the scenes.

        Raises:
            WorkspaceError: If a workspace is broken, or cannot be matched.
        """
        views = [view for path in scenes for view in labelled_views(path)]
        indices = np.linspace(0, len(views) - 1, min(most, len(views))).round()
        return cls(name=name, views=tuple(views[int(index)] for index in indices))

    def measure(self, network: ResDepthNet) -> tuple[Scores, list[BeforeAfter]]:
        """Refine the views; returns their scores, and some of the views to look at."""
        ratios: list[list[float]] = []
        pictures: list[BeforeAfter] = []
        for view, loaded in load_views(self.views, network.config.num_sources):
            initial, truth = loaded.inputs.depth, loaded.truth
            refined = refine_view(loaded.inputs, network, _REFINING).depth
            known = (truth > 0) & (initial > 0)
            ratios.append(_ratios(initial[known], refined[known], truth[known]))
            if len(pictures) < NUM_PICTURES:
                picture = BeforeAfter(
                    name=view.name,
                    rgb=read_rgb(view.workspace.image_path(view.image_name)),
                    before=initial,
                    after=refined,
                    truth=truth,
                )
                pictures.append(picture)
        columns = np.reshape(ratios, (-1, len(Scores._fields))).T
        return Scores(*map(_mean, columns.tolist())), pictures


@torch.inference_mode()
def mean_loss(network: ResDepthNet, crops: CropSet) -> float:
    """The loss over a few batches, the same each time."""
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
    """The ratios of one view, as in `Scores`; NaN where there was no error before."""
    after, before = (
        [np.mean(error), np.median(error), np.mean(error > _OFF * truth)]
        for error in (np.abs(refined - truth), np.abs(initial - truth))
    )
    return [
        float(new) / float(old) if old else math.nan
        for new, old in zip(after, before, strict=True)
    ]


def _mean(values: Sequence[float]) -> float:
    """The mean of the finite values; NaN if there are none."""
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else math.nan
