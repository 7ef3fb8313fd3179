"""Processes that start at once: forked from a server that has loaded what they need, instead of spawned."""

import os
import resource
from multiprocessing import forkserver
from multiprocessing.context import ForkServerProcess, SpawnContext
from typing import Any

import pytest


class WarmProcess(ForkServerProcess):
    """A forked process with the environment variables and the limit that a spawned one would have."""

    def __init__(self, *args: Any, **kwargs: Any):
        """Take down what the process that starts this one has now; the server began earlier."""
        super().__init__(*args, **kwargs)
        self._variables, self._file_size = dict(os.environ), resource.getrlimit(resource.RLIMIT_FSIZE)

    def run(self) -> None:
        """Do the work."""
        os.environ.clear()
        os.environ.update(self._variables)
        resource.setrlimit(resource.RLIMIT_FSIZE, self._file_size)
        super().run()


class WarmContext(SpawnContext):
    """The queues and pipes of spawned processes, and processes that are forked."""

    Process = WarmProcess  # type: ignore[assignment]  # forked, not spawned


def start_warm(patch: pytest.MonkeyPatch) -> None:
    """Let the package's pools and vectors of environments start such processes."""
    forkserver.set_forkserver_preload(["tests.helpers.warm_server"])
    forkserver.ensure_running()  # here, where interrupts are heard: what it forks hears what it does
    patch.setattr("chmarl_pb.processes.SpawnProcess", WarmProcess)
    patch.setattr("chmarl_pb.envs.vector.engine.get_context", lambda method: WarmContext())
