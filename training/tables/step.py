"""A step of a run in a process that ends with the table's: ``python -m training.tables.step MODULE [OPTION ...]``."""

import os
import runpy
import signal
import sys
import time
from threading import Thread

GRACE = 20.0  # seconds that an interrupted step has to save what it can


def main() -> None:
    """Run a module; standard input is a pipe that closes when the table's process is gone, however it ended."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    Thread(target=_watch, daemon=True).start()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


def _watch() -> None:
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(GRACE)
    os._exit(1)


if __name__ == "__main__":
    main()
