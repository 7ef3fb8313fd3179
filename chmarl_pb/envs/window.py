"""The window of ``render_mode="human"``."""

import os
import sys
from typing import Any

import numpy as np

from chmarl_pb.errors import OptionError
from chmarl_pb.extras import needs
from chmarl_pb.world import quiet

_NO_DISPLAY = (
    "render_mode='human' found no display to open a window on; use render_mode='rgb_array', watch in a browser by "
    "`chmarl-pb play`, or set the environment variable SDL_VIDEODRIVER=dummy for a window that nobody sees, as for "
    "gymnasium's check_env"
)
_WITHOUT_WINDOWS = ("offscreen", "dummy", "evdev")  # what SDL takes where there is no display
# Where SDL shows even plain pictures by OpenGL, unless told otherwise. OpenGL in software loads an LLVM, and PyTorch's
# Triton, which loads another with the first optimiser, then ends the process.
_BY_OPENGL = ("x11", "offscreen")
_windows: list[Any] = []  # the surface of the one window that this process has opened, if it has


def open_display() -> Any:
    """Return pygame with a display that it can open a window on.

    Raises:
        MissingExtraError: pygame, which opens windows, is not installed.
        OptionError: there is no display.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    with needs("render_mode='human'", "human"):
        import pygame
    if pygame.display.get_init():
        return pygame
    try:
        with quiet(2):  # SDL tells what is wrong with each kind of display that it tries
            pygame.display.init()
    except pygame.error as error:
        raise OptionError(f"{_NO_DISPLAY} (SDL: {error})") from error
    driver = pygame.display.get_driver()
    if driver in _WITHOUT_WINDOWS and not os.environ.get("SDL_VIDEODRIVER"):
        pygame.display.quit()
        raise OptionError(_NO_DISPLAY)
    if driver in _BY_OPENGL:
        os.environ.setdefault("SDL_FRAMEBUFFER_ACCELERATION", "0")
    return pygame


def show(picture: np.ndarray, title: str) -> None:
    """Show a picture (H, W, 3) in the process's window.

    Raises:
        OptionError: there is no pygame or no display.
    """
    pygame = open_display()
    size = picture.shape[1::-1]
    try:
        if not _windows or _windows[0].get_size() != size:
            _windows[:] = [pygame.display.set_mode(size)]
        pygame.display.set_caption(title)
        _windows[0].blit(pygame.surfarray.make_surface(picture.swapaxes(0, 1)), (0, 0))
        pygame.event.pump()
        pygame.display.flip()
    except pygame.error as error:
        raise OptionError(f"{_NO_DISPLAY} (SDL: {error})") from error


def close_window() -> None:
    """Close the process's window, if there is one; the next picture opens it again."""
    if _windows:
        _windows.clear()
        sys.modules["pygame"].display.quit()
