"""Configuration of the network: its size, its inputs and its outputs."""

import dataclasses
import enum
from typing import Self

from resdepth_colmap.config import Config

REPROJECTED_CHANGE, REPROJECTED = "reprojected_change", "reprojected"
"""Input channels of the depth maps of other views, reprojected into the reference: the
difference to the initial map, and whether there is a depth."""

RED, BLUE = "red", "blue"
"""Input channels of the reference in colour, besides its grey values."""

_RESAMPLED = ("source_there", "source_near", "source_far", "nearest", "farthest")
"""Inputs of the propagation network from source resampling: the first source at the
refined, the nearest and the farthest depth, and the last two of these depths."""


class InputVariant(enum.StrEnum):
    """Inputs of the network (paper, section "Network Variants")."""

    STEREO = "stereo"
    MONO = "mono"
    DEPTH_ONLY = "depth-only"
    IMAGES_ONLY = "images-only"


class Normalisation(enum.StrEnum):
    """How the inverse depth of a tile is scaled before it enters the network."""

    BASELINE = "baseline"  # the paper's: times the baseline, minus the tile's mean
    ROBUST = "robust"  # minus the tile's median, over half its 10-90 % spread


@dataclasses.dataclass(frozen=True, kw_only=True)
class NetworkConfig(Config):
    """The U-Net (paper, section "Network Architecture").

    Attributes:
        levels: Down-sampling levels; 7 for tiles of 512 px, 5 for tiles of 128 px.
        base_channels: Channels of the first level; they double with each level.
        max_channels: Where the doubling stops.
        variant: Which of depth and images are inputs.
        num_sources: Number of warped source images (variants stereo and images-only).
        valid: Input: the mask of pixels whose depth is measured, not filled.
        photo_consistency: Input: the local correlation of reference and warped source.
        source_depth: Input: the difference to the depth maps of other views,
            reprojected into the reference, and where they have a depth. They also fill
            the holes of the initial map.
        color: Input: the reference in colour.
        gate: Output: a learned gate in 0..1 that scales the residual.
        last_block: One more convolution block at full resolution before the last
            convolution.
        confidence: Output: the scale of the expected error.
        propagation_channels: Channels of the propagation network, which mixes the depth
            of each pixel from those around it (docs/adr/0015); 0 = no such network.
        source_resampling: The propagation network sees the first source warped by the
            refined depth and by the nearest and the farthest depth around each pixel,
            and may take these depths (docs/adr/0016).
        shared_features: The propagation network sees the features of the last
            convolution of the U-Net.
        normalisation: How inverse depth is scaled.
    """

    levels: int = 7
    base_channels: int = 16
    max_channels: int = 512
    variant: InputVariant = InputVariant.STEREO
    num_sources: int = 1
    valid: bool = True
    photo_consistency: bool = True
    source_depth: bool = True
    color: bool = True
    gate: bool = True
    last_block: bool = True
    confidence: bool = True
    propagation_channels: int = 72
    source_resampling: bool = True
    shared_features: bool = True
    normalisation: Normalisation = Normalisation.ROBUST

    def __post_init__(self) -> None:
        """Turn plain strings into their enums and check the ranges."""
        for name, kind in (("variant", InputVariant), ("normalisation", Normalisation)):
            value = getattr(self, name)
            choices = [str(choice) for choice in kind]
            self._check(value in choices, " or ".join(choices), name)
            object.__setattr__(self, name, kind(value))
        self._check(1 <= self.levels <= 9, "1 to 9", "levels")
        self._check(
            1 <= self.base_channels <= self.max_channels <= 1024,
            "1 <= base_channels <= max_channels <= 1024",
            "base_channels",
            "max_channels",
        )
        self._check(1 <= self.num_sources <= 8, "1 to 8", "num_sources")
        self._check(
            self.propagation_channels % 3 == 0
            and 0 <= self.propagation_channels <= 384,
            "a multiple of 3, 0 to 384",
            "propagation_channels",
        )

    @classmethod
    def paper(cls, variant: InputVariant = InputVariant.STEREO) -> Self:
        """The network of the paper: 64 to 512 channels, no extra inputs or outputs."""
        return cls(
            base_channels=64,
            variant=variant,
            valid=False,
            gate=False,
            last_block=False,
            photo_consistency=False,
            source_depth=False,
            color=False,
            confidence=False,
            propagation_channels=0,
            source_resampling=False,
            shared_features=False,
            normalisation=Normalisation.BASELINE,
        )

    @property
    def uses_sources(self) -> bool:
        """Whether warped source images are among the inputs."""
        return self.variant in (InputVariant.STEREO, InputVariant.IMAGES_ONLY)

    @property
    def residual(self) -> bool:
        """Whether the output is added to the initial inverse depth."""
        return self.variant is not InputVariant.IMAGES_ONLY

    @property
    def propagates(self) -> bool:
        """Whether a propagation network follows the U-Net."""
        return self.propagation_channels > 0 and self.residual

    @property
    def resamples_source(self) -> bool:
        """Whether the propagation network resamples the first source."""
        return self.source_resampling and self.propagates and self.uses_sources

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the input channels, in order."""
        names = ["inverse_depth"] if self.residual else []
        if self.variant is not InputVariant.DEPTH_ONLY:
            names.append("reference")
        if self.uses_sources:
            names += [f"source_{index}" for index in range(self.num_sources)]
        if self.valid:
            names.append("valid")
        if self.photo_consistency and self.uses_sources:
            names.append("photo_consistency")
        if self.source_depth and self.uses_sources and self.residual:
            names += [REPROJECTED_CHANGE, REPROJECTED]
        if self.color and self.variant is not InputVariant.DEPTH_ONLY:
            names += [RED, BLUE]
        return tuple(names)

    @property
    def propagation_inputs(self) -> tuple[str, ...]:
        """Names of the inputs of the propagation network, in order."""
        outputs = ["refined", "log_scale"] if self.confidence else ["refined"]
        resampled = _RESAMPLED if self.resamples_source else ()
        num_features = self.base_channels if self.shared_features else 0
        features = (f"feature_{index}" for index in range(num_features))
        return (*outputs, *self.channels, *resampled, *features)

    @property
    def multiple_px(self) -> int:
        """Input height and width must be multiples of this."""
        return int(2**self.levels)
