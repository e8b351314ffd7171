"""The stage "report": a page from maps, cloud and run record of a workspace."""

import logging
from pathlib import Path
from typing import Any

from resdepth_colmap.config import MaskConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace, read_record
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.io.point_cloud import read_cloud
from resdepth_colmap.pipeline.fuse.to_file import cloud_before_path, cloud_path
from resdepth_colmap.pipeline.masks import with_masks
from resdepth_colmap.pipeline.pictures import evenly_chosen
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.report.content import (
    MOST_BYTES,
    MOST_IMAGES,
    Budget,
    Content,
    cloud_content,
    color_tables,
    image_content,
)
from resdepth_colmap.report.facts import (
    Record,
    image_facts,
    left_out_facts,
    rounded,
    summary_facts,
)
from resdepth_colmap.report.image_maps import ImageMaps, load_maps
from resdepth_colmap.report.page import render_page
from resdepth_colmap.scene import Scene

logger = logging.getLogger(__name__)

REPORT_NAME = "report.html"


def write_report(
    path: Path, progress: Progress | None = None, masks: MaskConfig | None = None
) -> Path:
    """Write the report of a refined workspace.

    An image with missing or mismatched maps is left out, and the page gives the reason.

    Args:
        path: The workspace, or a parent of it.
        progress: Reports the progress.
        masks: What to leave out of the maps; None = what the refinement has left out.
            The cloud is shown as it is.

    Returns:
        The page, `resdepth/report.html`.

    Raises:
        WorkspaceError: If nothing was refined, no image can be shown, or the page
            cannot be written.
    """
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    asked, log = masks or MaskConfig(), masks is not None
    workspace = with_masks(workspace, scene, asked, after_run=True, log=log)
    record = read_record(OutputWorkspace(source=workspace).record_path)
    options = record.get("options")
    in_place = isinstance(options, dict) and options.get("in_place") is True
    output = OutputWorkspace(source=workspace, in_place=in_place)
    report = _Report(output, scene, record, progress or SilentProgress())
    target = output.path / REPORT_NAME
    write_whole(target, report.rendered().encode("utf-8"))
    return target


class _Report:
    """A report: its images, and the images that were left out."""

    def __init__(
        self, output: OutputWorkspace, scene: Scene, record: Record, progress: Progress
    ) -> None:
        self.output, self.scene = output, scene
        self.record, self.progress = record, progress
        self.images = _refined_images(output, scene, record)
        self.left_out: dict[str, str] = {}

    def rendered(self) -> str:
        shown = evenly_chosen(list(self.images), MOST_IMAGES)
        budget = Budget.of(len(shown))
        cloud = self._cloud(budget)
        fixed = len(self._page([], cloud))
        budget = self._fitted(shown, budget, MOST_BYTES - fixed)
        while True:
            contents = self._image_contents(shown, budget)
            page = self._page(contents, cloud)
            if len(page) <= MOST_BYTES:
                return page
            num_bytes = sum(content.num_bytes for content in contents)
            spare = MOST_BYTES - (len(page) - num_bytes)
            budget = budget.shrunk(num_bytes, spare)

    def _page(self, contents: list[Content], cloud: Content | None) -> str:
        images = [content.facts for content in contents]
        pixels = sum(image["width"] * image["height"] for image in images)
        num_pixels = round(pixels * len(self.images) / max(1, len(images)))
        title = self.output.source.path.resolve().name
        data = {
            "title": title,
            "summary": summary_facts(self.record, images, num_pixels),
            "skipped": left_out_facts(_strings(self.record.get("skipped"))),
            "leftOut": left_out_facts(self.left_out),
            "images": images,
            "cloud": None if cloud is None else cloud.facts,
            **color_tables(),
        }
        blocks: dict[str, bytes] = {}
        for content in [*contents, *([] if cloud is None else [cloud])]:
            blocks.update(content.blocks)
        return render_page(title, rounded(data), blocks)

    def _fitted(self, shown: list[str], budget: Budget, available: float) -> Budget:
        """A budget with which a few of the images need no more than their share."""
        names = evenly_chosen(shown, _NUM_TRIED)
        tried = [maps for maps in map(self._load, names) if maps is not None]
        share = available * len(tried) / len(shown)
        for _ in range(_MOST_TRIALS):
            size = sum(
                image_content(0, maps, _SPACE_FOR_FACTS, budget).num_bytes
                for maps in tried
            )
            size += len(_SPACE_FOR_FACTS["facts"]) * len(tried)
            if size <= share:
                break
            budget = budget.shrunk(size, share)
        return budget

    def _image_contents(self, names: list[str], budget: Budget) -> list[Content]:
        contents: list[Content] = []
        with self.progress.stage("Reporting", len(names)) as advance:
            for name in names:
                maps = self._load(name)
                if maps is not None:
                    facts = image_facts(maps, self.images[name])
                    contents.append(image_content(len(contents), maps, facts, budget))
                advance(1)
        if not contents:
            reason = next(iter(self.left_out.values()))
            raise WorkspaceError(
                f"{self.output.path}: no image can be shown: {reason.rstrip('.')}; run "
                f"`resdepth-colmap refine {self.output.source.path}` again."
            )
        return contents

    def _load(self, name: str) -> ImageMaps | None:
        """The maps of an image; None with one warning if they cannot be read."""
        if name in self.left_out:
            return None
        try:
            return load_maps(self.output, name, str(self.images[name].get("input")))
        except WorkspaceError as error:
            self.left_out[name] = str(error)
            logger.warning("%s is left out of the report: %s", name, error)
            return None

    def _cloud(self, budget: Budget) -> Content | None:
        paths = (cloud_path(self.output, "ply"), cloud_before_path(self.output))
        if not paths[0].is_file():
            return None
        offset = -self.scene.origin_in_world
        after, *before = (read_cloud(it).moved(offset) for it in paths if it.is_file())
        views = [view for view in self.scene.views if view.name in self.images]
        return cloud_content(after, before[0] if before else None, views, budget)


_NUM_TRIED = 4
_MOST_TRIALS = 20
_SPACE_FOR_FACTS = {"facts": " " * 1200}  # of one image, in the JSON of the page


def _refined_images(
    output: OutputWorkspace, scene: Scene, record: Record
) -> dict[str, Record]:
    """The record of each refined image, in the order of the model."""
    way_out = f"run `resdepth-colmap refine {output.source.path}` first"
    if not record:
        raise WorkspaceError(
            f"{output.record_path}: no record of a refinement; {way_out}."
        )
    known = record.get("images")
    known = known if isinstance(known, dict) else {}
    names = [view.name for view in scene.views if view.name in known]
    images = {name: known[name] for name in names if isinstance(known[name], dict)}
    if not images:
        raise WorkspaceError(f"{output.record_path}: no refined map; {way_out}.")
    return images


def _strings(value: Any) -> dict[str, str]:
    pairs = value.items() if isinstance(value, dict) else ()
    return {str(name): str(reason) for name, reason in pairs}
