"""What a run says of its machine."""

import os
import re

import pytest
import torch

from resdepth_colmap.versions import hardware, peak_memory_mb, versions


def test_the_hardware_names_processor_cores_and_gpu() -> None:
    processor, cores, gpu = hardware().rsplit(", ", 2)
    assert processor
    assert re.fullmatch(r"[1-9]\d* cores?", cores)
    assert (gpu == "no GPU") == (
        not torch.cuda.is_available() and not torch.backends.mps.is_available()
    )


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="Linux only")
def test_only_cores_that_may_be_used_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3})
    assert ", 1 core, " in hardware()


def test_a_gpu_has_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda: "NVIDIA H200")
    assert hardware().endswith(" cores, NVIDIA H200") or ", 1 core, " in hardware()


def test_versions_and_memory_are_those_of_this_process() -> None:
    assert versions()["torch"] == torch.__version__
    assert (peak_memory_mb() or 1) > 0
