"""The command `refine`: refinement, fusion and report."""

import dataclasses
import time
from pathlib import Path

from resdepth_colmap.errors import FusionError
from resdepth_colmap.io.colmap.output import OutputWorkspace, read_record, write_record
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.pipeline.run import RunResult, run_refine
from resdepth_colmap.pipeline.run_config import RunConfig
from resdepth_colmap.progress import Progress
from resdepth_colmap.report.write_report import REPORT_NAME, write_report


def refine_and_report(
    path: Path, config: RunConfig | None = None, progress: Progress | None = None
) -> RunResult:
    """Refine a workspace and write its report.

    Args:
        path: The workspace, or a parent of it.
        config: Options; None = the defaults.
        progress: Reports the progress of each stage.

    Raises:
        ResDepthError: As `run_refine`; after a failed fusion the report exists.
    """
    try:
        result = run_refine(path, config, progress)
    except FusionError:  # maps and record exist
        _report(path, progress)
        raise
    report_path = result.refine.output.path / REPORT_NAME
    if not (result.is_idle and report_path.is_file()):
        report_path = _report(path, progress)
    return dataclasses.replace(result, report_path=report_path)


def _report(path: Path, progress: Progress | None) -> Path:
    """Write the report, and add its seconds to the run record."""
    start = time.perf_counter()
    report_path = write_report(path, progress)
    record_path = OutputWorkspace(source=open_workspace(path)).record_path
    record = read_record(record_path)
    seconds = {**record.get("seconds", {}), "report": time.perf_counter() - start}
    seconds["report"] = round(seconds["report"], 3)
    write_record(record_path, {**record, "seconds": seconds})
    return report_path
