"""Crops of training samples: cut, mirrored, and with brightness and contrast varied."""

import collections
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch.utils.data import Dataset

from resdepth_colmap.geometry.pixels import cropped_K, mirrored_K
from resdepth_colmap.network.network_config import BLUE, RED, NetworkConfig
from resdepth_colmap.training.data.crop_sampler import Draw
from resdepth_colmap.training.data.samples import Sample, guidance_names, read_sample


class Crop(NamedTuple):
    """A crop for one network.

    Attributes:
        sample: The window of the sample; its guidance has the network's channels only.
        batch_names: Names of the samples of the batch, over all processes.
    """

    sample: Sample
    batch_names: tuple[str, ...]


class CropDataset(Dataset[Crop]):
    """The crops of all samples; a draw is the index of one.

    Args:
        network: The network that sees them.
        vary_light: Change brightness and contrast at random.
    """

    def __init__(self, network: NetworkConfig, vary_light: bool) -> None:  # noqa: D107
        self.names = [name for name in network.channels if name != "inverse_depth"]
        stored = guidance_names(network.num_sources)
        self._channels = [stored.index(name) for name in self.names]
        self._vary_light = vary_light

    def __getitem__(self, draw: Draw) -> Crop:
        """Read a sample and cut the crop.

        The sources in it were warped into the reference camera before: mirrored
        together, all channels are those of a mirrored pair of views. The source for
        resampling stays as it is: the camera of the crop is mirrored.
        """
        sample, rng = read_sample(draw.path), draw.rng
        rows, columns = (
            _window(size, length, rng)
            for size, length in zip(sample.target.shape, draw.shape, strict=True)
        )
        flip = -1 if rng.random() < 0.5 else 1

        def cut(values: NDArray) -> NDArray:  # type: ignore[type-arg] # any dtype
            return np.ascontiguousarray(values[..., rows, columns][..., ::flip])

        K = cropped_K(sample.K, columns.start, rows.start)
        crop = sample._replace(
            inverse_depth=cut(sample.inverse_depth),
            target=cut(sample.target),
            valid=cut(sample.valid),
            guidance=cut(sample.guidance[self._channels]),
            K=K if flip > 0 else mirrored_K(K, columns.stop - columns.start),
        )
        if self._vary_light:
            crop = self._other_light(crop, rng)
        return Crop(crop, draw.batch_names)

    def _other_light(self, crop: Sample, rng: np.random.Generator) -> Sample:
        """Another gamma and brightness for all images, and a little for each."""
        common = np.exp(rng.normal(0.0, (0.15, 0.1)))
        # One for all channels of an image.
        lights: dict[str, NDArray[np.float64]] = collections.defaultdict(
            lambda: common * np.exp(rng.normal(0.0, 0.05, size=2))
        )
        guidance = crop.guidance.copy()
        for index, name in enumerate(self.names):
            image = "reference" if name in (RED, BLUE) else name
            if image == "reference" or image.startswith("source"):
                guidance[index] = _lit(guidance[index], *lights[image])
        source_gray = _lit(crop.source_gray, *lights["source_0"])
        return crop._replace(guidance=guidance, source_gray=source_gray)


def _window(size_px: int, length_px: int, rng: np.random.Generator) -> slice:
    start = int(rng.integers(size_px - length_px + 1))
    return slice(start, start + length_px)


def _lit(values: NDArray[np.float16], gamma: float, gain: float) -> NDArray[np.float16]:
    lit = np.clip(values.astype(np.float32), 0.0, 1.0) ** np.float32(gamma) * gain
    return np.asarray(np.clip(lit, 0.0, 1.0), np.float16)
