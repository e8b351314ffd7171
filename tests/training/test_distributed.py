"""Laws of several processes: they train as one would with all of their batches."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from gradient_worker import take_step
from noisy_planes import write_noisy_plane

from resdepth_colmap.config import Device
from resdepth_colmap.errors import ConfigError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, save_weights
from resdepth_colmap.training.data.samples import prepare_samples
from resdepth_colmap.training.distributed import Ranks, join_ranks

NETWORK = NetworkConfig(levels=2, base_channels=4, max_channels=8)
TIMEOUT_S = 400


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    """Random ones, the last layer too: a fresh network gives the others no gradient."""
    torch.manual_seed(0)
    network = ResDepthNet(NETWORK)
    torch.nn.init.normal_(network.head.weight, std=0.1)
    path = tmp_path / "first.safetensors"
    save_weights(path, network)
    return path


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def environment(**more: str) -> dict[str, str]:
    tests = Path(__file__).resolve().parents[1]
    threads = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    path = os.pathsep.join([str(tests), str(tests.parent)])
    return {**os.environ, **threads, "PYTHONPATH": path, **more}


def run_two(arguments: list[str]) -> None:
    """Run the worker twice, as torchrun would."""
    worker = Path(__file__).resolve().parents[1] / "gradient_worker.py"
    shared = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(free_port())}
    processes = [
        subprocess.Popen(
            [sys.executable, str(worker), *arguments],
            env=environment(
                WORLD_SIZE="2", RANK=str(rank), LOCAL_RANK=str(rank), **shared
            ),
        )
        for rank in range(2)
    ]
    try:
        codes = [process.wait(TIMEOUT_S) for process in processes]
    finally:
        for process in processes:
            process.kill()
    assert codes == [0, 0]


@pytest.mark.slow
def test_two_processes_have_the_gradients_of_one_with_both_their_batches(
    tmp_path: Path, weights: Path
) -> None:
    scene = write_noisy_plane(tmp_path / "plane", unknown_share=0.3)
    paths = prepare_samples([scene], NETWORK, tmp_path / "samples")
    samples = paths[0].parent
    take_step(samples, weights, tmp_path)
    run_two([str(samples), str(weights), str(tmp_path)])
    one, first, second = (
        torch.load(tmp_path / f"{name}.pt") for name in ("0_of_1", "0_of_2", "1_of_2")
    )
    assert [float(result["crops"]) for result in (one, first, second)] == [4, 2, 2]
    assert float(first["stop"]) == float(second["stop"]) == 1
    for result in (first, second):
        for name in one.keys() - {"crops", "stop"}:
            scale = float(one[name].abs().max())
            np.testing.assert_allclose(
                result[name], one[name], atol=1e-4 * scale, rtol=1e-3, err_msg=name
            )
    assert max(float(one[name].abs().max()) for name in one if "encoder.0" in name) > 0


@pytest.mark.slow
def test_torchrun_trains_with_two_processes(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        write_noisy_plane(tmp_path / "scenes" / name)
    output = tmp_path / "run"
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node=2"]
    options = "--steps 3 --batch-size 2 --crop-px 32 --levels 3 --base-channels 4 "
    options += "--validation-steps 2 --validation-share 0.3 --device cpu"
    done = subprocess.run(
        [
            *torchrun,
            f"--master-port={free_port()}",
            *["-m", "resdepth_colmap", "-q", "train", str(tmp_path / "scenes")],
            *["--output", str(output), *options.split()],
        ],
        env=environment(),
        check=True,
        timeout=TIMEOUT_S,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert done.stdout == f"{output / 'best.safetensors'}\n"
    assert load_weights(output / "best.safetensors").config.levels == 3
    lines = (output / "log.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["step", "2", "3"]


def test_a_process_alone_sums_and_shares_with_itself() -> None:
    with join_ranks(Device.CPU) as ranks:
        assert ranks.is_first
        assert ranks.summed([1.0, 2.5]) == [1.0, 2.5]
        assert ranks.from_first(lambda: "made") == "made"


def test_a_batch_that_cannot_be_dealt_out_is_refused() -> None:
    Ranks(rank=1, count=2).check_batch(4)
    with pytest.raises(ConfigError, match=r"batch_size=5.*2 processes"):
        Ranks(rank=1, count=2).check_batch(5)
