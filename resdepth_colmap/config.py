"""Every option of the program: each default once, checked once."""

import dataclasses
import enum
from pathlib import Path
from typing import Any, Self

from resdepth_colmap.errors import ConfigError


class StereoBackend(enum.StrEnum):
    """Where initial depth comes from."""

    AUTO = "auto"
    COLMAP = "colmap"
    CPU = "cpu"
    EXISTING = "existing"


class Device(enum.StrEnum):
    """Where the network runs."""

    AUTO = "auto"
    CPU = "cpu"
    CUDA = "cuda"
    MPS = "mps"


class Fuser(enum.StrEnum):
    """Who makes the cloud."""

    OPEN3D = "open3d"
    COLMAP = "colmap"


def option(name: str, default: Any) -> Any:
    """An attribute of a configuration whose option has another name."""
    return dataclasses.field(default=default, metadata={"option": name})


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """Base of the configurations: to and from plain mappings."""

    @classmethod
    def from_mapping(cls, mapping: dict[str, Any]) -> Self:
        """Build from a mapping, as a weights header or a run record holds it.

        Raises:
            ConfigError: For a key that this configuration does not have.
        """
        fields = {field.name: field for field in dataclasses.fields(cls)}
        for key in mapping:
            if key not in fields:
                known = ", ".join(fields)
                raise ConfigError(f"unknown option {key!r}; known are: {known}.")
        return cls(**mapping)

    def to_mapping(self) -> dict[str, Any]:
        """Plain values only, ready for JSON."""
        return {key: _plain(value) for key, value in vars(self).items()}

    def _check(self, holds: bool, expected: str, *names: str) -> None:
        """ConfigError with the values of the named attributes, unless it holds."""
        if not holds:
            fields = dataclasses.fields(self)
            options = {it.name: it.metadata.get("option", it.name) for it in fields}
            values = (f"{options[name]}={getattr(self, name)!r}" for name in names)
            shown = ", ".join(values)
            raise ConfigError(f"{shown} but expected {expected}.")


def _plain(value: Any) -> Any:
    if isinstance(value, enum.StrEnum | Path):
        return str(value)
    return value


@dataclasses.dataclass(frozen=True, kw_only=True)
class MaskConfig(Config):
    """Where it is written which pixels of the images are to be ignored.

    Attributes:
        mask_path: Folder of masks, "<image name>.png" or "<image name without its
            suffix>.png", of the shape of the image; where one is 0, the pixel is
            ignored. Without it: the folder of the run before, else "masks" beside
            "images".
        alpha_masks: Ignore the pixels of an image whose alpha is 0.
        use_masks: Use masks; without them all pixels count.
    """

    mask_path: Path | None = None
    alpha_masks: bool = False
    use_masks: bool = option("masks", True)

    def __post_init__(self) -> None:
        """Check that masks are not asked for and refused at once."""
        asked = self.mask_path is not None or self.alpha_masks
        self._check(
            self.use_masks or not asked,
            "no mask_path and no alpha_masks without masks",
            "use_masks",
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class StereoConfig(Config):
    """The CPU PatchMatch. Names and meanings are those of COLMAP's options.

    Attributes:
        window_radius: Half width of the matching window, in pixels.
        window_step: Sample every so many pixels of the window.
        sigma_color: Spread of the bilateral weight in grey values (0..1).
        smoothness: Weight of the roughness of the surface, beside a matching cost in
            0..2; 0 = each pixel for itself, as in COLMAP.
        num_iterations: Red-black sweeps over the image; half as many in the geometric
            pass.
        max_num_sources: Use at most so many of the sources that patch-match.cfg names;
            of automatic ones and of all, good ones that together see the image.
        max_image_size: Longest image side to match at, in pixels; -1 = as it is.
        depth_min: Nearest depth, in workspace units; -1 = from the scene.
        depth_max: Farthest depth, in workspace units; -1 = from the scene.
        min_triangulation_angle: Least angle, in degrees, of the sparse points that an
            automatically chosen source shares with the image.
        geom_consistency: Match a second time, against the depth maps of the first.
        filter: Drop what too few sources agree with.
        filter_min_ncc: Least correlation with a source that agrees.
        filter_min_triangulation_angle: Least angle, in degrees, to a source that
            agrees.
        filter_min_num_consistent: Sources that have to agree.
        filter_geom_consistency_max_cost: Largest error there and back, in pixels, of a
            source that agrees.
        write_consistency_graph: Write down which sources agree with each pixel, too.
        cache_size: Memory for images and maps that are needed again, in GB.
        seed: Seed of the random hypotheses.
    """

    window_radius: int = 4
    window_step: int = 2
    sigma_color: float = 0.06
    smoothness: float = 1.0
    num_iterations: int = 4
    max_num_sources: int = 6
    max_image_size: int = -1
    depth_min: float = -1.0
    depth_max: float = -1.0
    min_triangulation_angle: float = 1.0
    geom_consistency: bool = True
    filter: bool = True
    filter_min_ncc: float = 0.1
    filter_min_triangulation_angle: float = 3.0
    filter_min_num_consistent: int = 2
    filter_geom_consistency_max_cost: float = 1.0
    write_consistency_graph: bool = False
    cache_size: float = 0.25
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the ranges once, so that no later code has to."""
        self._check(1 <= self.window_radius <= 15, "1 to 15", "window_radius")
        self._check(
            1 <= self.window_step <= self.window_radius,
            "1 to the window radius",
            "window_step",
        )
        self._check(self.sigma_color > 0, "more than 0", "sigma_color")
        self._check(self.smoothness >= 0, "0 or more", "smoothness")
        self._check(self.num_iterations >= 1, "at least 1", "num_iterations")
        self._check(1 <= self.max_num_sources <= 32, "1 to 32", "max_num_sources")
        self._check(
            self.max_image_size == -1 or self.max_image_size >= 32,
            "-1 or at least 32",
            "max_image_size",
        )
        given = not (self.depth_min < 0 and self.depth_max < 0)
        self._check(
            not given or 0 < self.depth_min < self.depth_max,
            "0 < depth_min < depth_max, both given or neither",
            "depth_min",
            "depth_max",
        )
        self._check(self.cache_size >= 0, "0 or more", "cache_size")
        self._check_filter()

    def _check_filter(self) -> None:
        self._check(-1 <= self.filter_min_ncc <= 1, "-1 to 1", "filter_min_ncc")
        for name in ("min_triangulation_angle", "filter_min_triangulation_angle"):
            self._check(0 <= getattr(self, name) <= 180, "0 to 180 degrees", name)
        self._check(
            self.filter_min_num_consistent >= 0,
            "at least 0",
            "filter_min_num_consistent",
        )
        self._check(
            self.filter_geom_consistency_max_cost >= 0,
            "at least 0",
            "filter_geom_consistency_max_cost",
        )
        self._check(
            self.filter or not self.write_consistency_graph,
            "a filter: it is what tells who agrees",
            "write_consistency_graph",
            "filter",
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class RefineConfig(Config):
    """How depth maps are refined.

    Attributes:
        input: Which maps to start from: auto (the fuller one), or a kind of map,
            that is the word before ".bin" in its file name.
        inner_iterations: How often to warp and refine (the paper's iter: 2).
        outer_iterations: Outer iterations over all views: from the second on, each view
            is compared with the refined maps of the other views, not with their initial
            ones. A network that sees no other maps needs one.
        update_gating: Keep the initial depth of a pixel that other maps or the
            photographs support where the network's update is small and the photographs
            speak against it, or where it is small beside the network's expected error.
        fit_scale: Rescale depth maps that are not at the scale of the model, by the
            sparse points, instead of refusing them.
        keep_empty: Leave the pixels empty that have no depth in the initial map (0,
            negative or not finite), instead of filling them.
        tile_px: Side of a square tile, in pixels.
        overlap_px: Overlap of neighbouring tiles, in pixels.
        device: Where the network runs.
        weights: Weights file; None = those shipped with the package.
    """

    input: str = "auto"
    inner_iterations: int = option("passes", 1)
    outer_iterations: int = option("rounds", 3)
    update_gating: bool = True
    fit_scale: bool = False
    keep_empty: bool = False
    tile_px: int = 512
    overlap_px: int = 128
    device: Device = Device.AUTO
    weights: Path | None = None

    def __post_init__(self) -> None:
        """Check the ranges once, so that no later code has to."""
        for name in ("inner_iterations", "outer_iterations"):
            self._check(1 <= getattr(self, name) <= 10, "1 to 10", name)
        self._check(
            self.tile_px >= 32 and self.tile_px % 32 == 0, "a multiple of 32", "tile_px"
        )
        self._check(
            0 <= self.overlap_px <= self.tile_px // 2, "0 to half a tile", "overlap_px"
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class FuseConfig(Config):
    """How refined maps become one cloud.

    Attributes:
        fuser: Ours on open3d, or COLMAP's own stereo_fusion.
        min_num_views: Views that must agree on a point, its own one included.
        max_depth_error: Largest relative difference of two views' depths.
        max_reproj_error: Largest error of re-projection there and back, in pixels.
        max_normal_error_deg: Largest angle between two views' normals.
        min_confidence: Least confidence of a pixel (0..1); 0 = take all.
        voxel_size: Side of the voxels that are averaged, in workspace units; 0 = off.
        remove_outliers: Drop points far from their neighbours (open3d's statistical
            rule: 20 neighbours, 2 standard deviations).
    """

    fuser: Fuser = Fuser.OPEN3D
    min_num_views: int = 3
    max_depth_error: float = 0.01
    max_reproj_error: float = 2.0
    max_normal_error_deg: float = 30.0
    min_confidence: float = 0.0
    voxel_size: float = 0.0
    remove_outliers: bool = False

    def __post_init__(self) -> None:
        """Check the ranges once, so that no later code has to."""
        self._check(self.min_num_views >= 1, "at least 1", "min_num_views")
        self._check(0 < self.max_depth_error < 1, "between 0 and 1", "max_depth_error")
        self._check(self.max_reproj_error > 0, "more than 0", "max_reproj_error")
        self._check(
            0 < self.max_normal_error_deg <= 180, "0 to 180", "max_normal_error_deg"
        )
        self._check(0 <= self.min_confidence <= 1, "0 to 1", "min_confidence")
        self._check(self.voxel_size >= 0, "0 or more", "voxel_size")


@dataclasses.dataclass(frozen=True, kw_only=True)
class SynthesisConfig(Config):
    """Rendered rooms, to train on and to show with.

    Attributes:
        num_scenes: Rooms to render.
        num_views: Views of each room, 2 to 12.
        width_px: Image width.
        height_px: Image height.
        seed: Seed of the first room; room i has seed + i.
    """

    num_scenes: int = 1
    num_views: int = 5
    width_px: int = 640
    height_px: int = 480
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the ranges once, so that no later code has to."""
        self._check(self.num_scenes >= 1, "at least 1", "num_scenes")
        self._check(2 <= self.num_views <= 12, "2 to 12", "num_views")
        self._check(
            min(self.width_px, self.height_px) >= 32,
            "at least 32",
            "width_px",
            "height_px",
        )
