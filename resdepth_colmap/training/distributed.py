"""The processes of one training: alone, or several that torchrun started."""

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
"""The others wait while the first process matches and prepares samples."""

Value = TypeVar("Value")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Ranks:
    """This process among all.

    Attributes:
        rank: Its number, from 0.
        count: How many there are.
        device: Where this one computes.
    """

    rank: int = 0
    count: int = 1
    device: torch.device = dataclasses.field(
        default_factory=lambda: torch.device("cpu")
    )

    @property
    def is_first(self) -> bool:
        """Whether it is the one that logs, validates and saves."""
        return self.rank == 0

    def summed(self, values: Sequence[float]) -> list[float]:
        """Each value's sum over all processes."""
        if self.count == 1:
            return list(values)
        tensor = torch.tensor(values, dtype=torch.float64, device=self.device)
        distributed.all_reduce(tensor)
        return [float(value) for value in tensor]

    def from_first(self, make: Callable[[], Value]) -> Value:
        """What the first process makes, in all of them; the others wait for it."""
        if self.count == 1:
            return make()
        box: list[object] = [make() if self.is_first else None]
        distributed.broadcast_object_list(box, src=0, device=self.device)
        return cast(Value, box[0])

    def check_batch(self, batch_size: int) -> None:
        """Check that a batch can be dealt out evenly.

        Raises:
            ConfigError: If it cannot.
        """
        if batch_size % self.count:
            raise ConfigError(
                f"{batch_size=} but expected a multiple of the {self.count} processes "
                "that torchrun started."
            )


def is_first_process() -> bool:
    """Whether this process is alone or the first one of torchrun's."""
    return os.environ.get("RANK", "0") == "0"


@contextlib.contextmanager
def join_ranks(device: Device) -> Iterator[Ranks]:
    """Join the processes that torchrun started; without torchrun there is but one.

    Args:
        device: Where to compute. `auto` gives each process a CUDA device of its own
            where there is any, else the CPU.

    Raises:
        BackendUnavailableError: If the device is not there, or there are fewer CUDA
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
            f"{torch.cuda.device_count()} CUDA devices on this machine, but torchrun "
            f"started a process number {local_rank} here; lower --nproc-per-node, or "
            "train with --device cpu."
        )
    torch.cuda.set_device(local_rank)
    return torch.device("cuda", local_rank)
