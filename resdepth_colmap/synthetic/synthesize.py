"""Rendered rooms as COLMAP workspaces with exact depth, for training and the demo."""

import dataclasses
import multiprocessing
import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pycolmap

from resdepth_colmap.config import SynthesisConfig
from resdepth_colmap.io.colmap import cfg
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.output import make_folder
from resdepth_colmap.io.images import write_png
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import ColorImage, DepthMap, View
from resdepth_colmap.synthetic.render import Tracer
from resdepth_colmap.synthetic.room import Style, build_room
from resdepth_colmap.synthetic.sensor import Sensor
from resdepth_colmap.synthetic.sparse_points import SparsePoints, sample_points
from resdepth_colmap.synthetic.viewpoints import choose_views

_TABLE_SHARE = 0.5
_STREAM = 20200614  # a random stream apart from other uses of the seed


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class RenderedScene:
    """A rendered room.

    Attributes:
        views: Cameras and poses.
        images: The image of each view, shape (H, W, 3), uint8.
        depths: Exact depth at the pixel centres, shape (H, W), float32; 0 = no hit.
        points: Sparse points with their tracks.
    """

    views: tuple[View, ...]
    images: tuple[ColorImage, ...]
    depths: tuple[DepthMap, ...]
    points: SparsePoints


def render_room(
    config: SynthesisConfig, seed: int, style: Style | None = None
) -> RenderedScene:
    """Render a room. The same arguments give the same bytes.

    Args:
        config: Number and size of the views (its seed is not used).
        seed: Seed of the room.
        style: What the cameras look at; None = drawn by the seed.
    """
    rng = np.random.default_rng([_STREAM, seed])
    drawn = Style.TABLE if rng.random() < _TABLE_SHARE else Style.ROOM
    room = build_room(rng, drawn if style is None else style, config.width_px)
    tracer = Tracer(room)
    views = choose_views(rng, room, config, tracer.depth)
    sensor = Sensor.draw(rng)
    gain = 0.0
    images, depths = [], []
    for view in views:
        radiance = tracer.radiance(view)
        gain = gain or sensor.gain_for(radiance)
        images.append(sensor.expose(rng, radiance, gain))
        depths.append(tracer.depth(view))
    points = sample_points(rng, views, images, depths)
    return RenderedScene(
        views=views, images=tuple(images), depths=tuple(depths), points=points
    )


def write_scene(path: Path, scene: RenderedScene) -> None:
    """Write a rendered room as a COLMAP dense workspace, with its exact depth.

    Args:
        path: The workspace: images/, sparse/, stereo/ (no maps yet) and
            ground_truth/<image name>.bin in COLMAP's map format.
        scene: What to write.

    Raises:
        WorkspaceError: If a file cannot be written.
    """
    for folder in ("depth_maps", "normal_maps", "consistency_graphs"):
        make_folder(path / "stereo" / folder)
    make_folder(path / "sparse")
    for view, image, depth in zip(scene.views, scene.images, scene.depths, strict=True):
        write_png(path / "images" / view.name, image)
        write_depth_map(path / "ground_truth" / f"{view.name}.bin", depth)
    names = [view.name for view in scene.views]
    automatic = cfg.SourceSpec(kind=cfg.SourceKind.AUTO, num_auto=20)
    sources = dict.fromkeys(names, automatic)
    cfg.write_patch_match_cfg(path / "stereo" / "patch-match.cfg", sources)
    cfg.write_fusion_cfg(path / "stereo" / "fusion.cfg", names)
    _reconstruction(scene).write(path / "sparse")


def _reconstruction(scene: RenderedScene) -> pycolmap.Reconstruction:
    model = pycolmap.Reconstruction()
    points = scene.points
    first = scene.views[0].camera
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(
            model="PINHOLE",
            width=first.width_px,
            height=first.height_px,
            params=[first.fx, first.fy, first.cx, first.cy],
            camera_id=1,
        )
    )
    tracks = [pycolmap.Track() for _ in points.xyz]
    for visible, xy, view in zip(points.visible, points.xy, scene.views, strict=True):
        seen = np.flatnonzero(visible)
        for index, point in enumerate(seen):
            tracks[point].add_element(view.image_id, index)
        image = pycolmap.Image(
            name=view.name,
            keypoints=xy[seen],
            camera_id=1,
            image_id=view.image_id,
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(view.cam_from_world))
    for xyz, track, rgb in zip(points.xyz, tracks, points.rgb, strict=True):
        model.add_point3D(xyz, track, rgb)
    model.update_point_3d_errors()
    return model


def synthesize(
    output: Path,
    config: SynthesisConfig,
    progress: Progress | None = None,
    num_workers: int = 1,
) -> list[Path]:
    """Render rooms into workspaces `output`/room_<seed>; finished ones are kept.

    Args:
        output: Folder of the workspaces.
        config: Number of rooms, first seed, number and size of the views.
        progress: Advances with each room.
        num_workers: Number of processes.

    Returns:
        The workspaces, in the order of their seeds.

    Raises:
        WorkspaceError: If a file cannot be written.
    """
    seeds = range(config.seed, config.seed + config.num_scenes)
    render = partial(_render_into, output, config)
    paths = []
    with (progress or SilentProgress()).stage("Rendering", len(seeds)) as advance:
        for path in _run(render, seeds, num_workers):
            paths.append(path)
            advance(1.0)
    return paths


def _run(
    render: Callable[[int], Path], seeds: Sequence[int], num_workers: int
) -> Iterator[Path]:
    if num_workers <= 1:
        yield from map(render, seeds)
        return
    # spawn: a forked child would inherit the threads of open3d half alive
    with multiprocessing.get_context("spawn").Pool(num_workers) as pool:
        yield from pool.imap(render, seeds)
        # a terminated worker would print a stack (pycolmap's signal handler)
        pool.close()
        pool.join()


def _render_into(output: Path, config: SynthesisConfig, seed: int) -> Path:
    path = output / f"room_{seed:06d}"
    if path.exists():
        return path
    unfinished = output / f".room_{seed:06d}.partial"
    shutil.rmtree(unfinished, ignore_errors=True)
    write_scene(unfinished, render_room(config, seed))
    unfinished.rename(path)
    return path
