"""The processes of one training: one, or several that torchrun starts."""

import contextlib
import dataclasses
import datetime
import os
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar, cast

import torch
from torch import distributed

from resdepth_colmap.config import Device
from resdepth_colmap.errors import BackendUnavailableError, ConfigError
from resdepth_colmap.network.device import resolve_device

LONGEST_WAIT = datetime.timedelta(days=1)
"""Timeout of the other processes while the first one matches and prepares samples."""

Value = TypeVar("Value")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Ranks:
    """This process among all.

    Attributes:
        rank: Index of this process.
        count: Number of processes.
        device: Device of this process.
    """

    rank: int = 0
    count: int = 1
    device: torch.device = dataclasses.field(
        default_factory=lambda: torch.device("cpu")
    )

    @property
    def is_first(self) -> bool:
        """Whether this process logs, validates and saves."""
        return self.rank == 0

    def summed(self, values: Sequence[float]) -> list[float]:
        """Each value's sum over all processes."""
        if self.count == 1:
            return list(values)
        tensor = torch.tensor(values, dtype=torch.float64, device=self.device)
        distributed.all_reduce(tensor)
        return [float(value) for value in tensor]

    def from_first(self, make: Callable[[], Value]) -> Value:
        """The result of the first process, in all of them; the others wait for it."""
        if self.count == 1:
            return make()
        box: list[object] = [make() if self.is_first else None]
        distributed.broadcast_object_list(box, src=0, device=self.device)
        return cast(Value, box[0])

    def check_batch(self, batch_size: int) -> None:
        """Check that a batch divides evenly among the processes.

        Raises:
            ConfigError: If it does not.
        """
        if batch_size % self.count:
            raise ConfigError(
                f"{batch_size=} but expected a multiple of the {self.count} processes "
                "of torchrun."
            )


def is_first_process() -> bool:
    """Whether this process is the only one or the first one of torchrun."""
    return os.environ.get("RANK", "0") == "0"


@contextlib.contextmanager
def join_ranks(device: Device) -> Iterator[Ranks]:
    """Join the processes of torchrun; without torchrun there is only this one.

    Args:
        device: Device to compute on. `auto` gives each process another CUDA device if
            there is any, else the CPU.

    Raises:
        BackendUnavailableError: If the device does not exist, or there are fewer CUDA
            devices than processes on this machine.
    """
    count = int(os.environ.get("WORLD_SIZE", "1"))
    if count == 1:
        yield Ranks(device=resolve_device(device))
        return
    own = _own_device(device)
    backend = "nccl" if own.type == "cuda" else "gloo"
    distributed.init_process_group(backend, timeout=LONGEST_WAIT)
    try:
        yield Ranks(rank=distributed.get_rank(), count=count, device=own)
    finally:
        distributed.destroy_process_group()


def _own_device(device: Device) -> torch.device:
    if resolve_device(device).type != "cuda":
        return torch.device("cpu")
    local_rank = int(os.environ.get("LOCAL_RANK", "0"))
    if local_rank >= torch.cuda.device_count():
        raise BackendUnavailableError(
            f"{torch.cuda.device_count()} CUDA devices on this machine are too few for "
            f"process {local_rank} of torchrun (counted from 0); lower "
            "--nproc-per-node, or train with --device cpu."
        )
    torch.cuda.set_device(local_rank)
    return torch.device("cuda", local_rank)
