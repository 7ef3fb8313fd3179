"""Devices of torch, by name."""

import torch

from chmarl_pb.errors import OptionError


def find_device(name: str) -> torch.device:
    """Return a device that tensors can be put on.

    Raises:
        OptionError: torch does not know it, or this machine has none.
    """
    try:
        device = torch.zeros(1, device=name).device
        if device.type == "meta":
            raise NotImplementedError("it keeps no numbers")
        return device
    except (RuntimeError, AssertionError, NotImplementedError, ImportError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise OptionError(f"device={name!r}: {reason}; use 'cpu', or 'cuda' where torch finds a GPU") from error
