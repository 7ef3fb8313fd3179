"""Show what the robots see: as one picture, or in a window."""

import os
from typing import Any

import cv2
import numpy as np

from chmarl_pb.errors import OptionError
from chmarl_pb.sensing.sight import Sight

_LABELS = {"humanoid": "humanoid", "drone": "drone"}
_windows: dict[str, Any] = {}


def side_by_side(sight: Sight, size: int) -> np.ndarray:
    """Return the pictures of both robots next to each other, (size, 2 size, 3) uint8."""
    pictures = []
    for robot, label in _LABELS.items():
        picture = sight.colours(robot, size)
        cv2.putText(picture, label, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (20, 20, 20), 3, cv2.LINE_AA)
        cv2.putText(picture, label, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
        pictures.append(picture)
    return np.concatenate(pictures, axis=1)


def show(picture: np.ndarray, title: str) -> None:
    """Show a picture (H, W, 3) in the process's window.

    Raises:
        OptionError: pygame, which opens windows, is not installed, or there is no display.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise OptionError("render_mode='human' opens a window with pygame; run `pip install pygame`") from error
    try:
        if "screen" not in _windows:
            pygame.display.init()
            _windows["screen"] = pygame.display.set_mode(picture.shape[1::-1])
        pygame.display.set_caption(title)
        _windows["screen"].blit(pygame.surfarray.make_surface(picture.swapaxes(0, 1)), (0, 0))
        pygame.event.pump()
        pygame.display.flip()
    except pygame.error as error:
        raise OptionError(
            f"render_mode='human' found no display ({error}); use render_mode='rgb_array' on a machine without one"
        ) from error
