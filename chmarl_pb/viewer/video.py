"""Writes frames as an H.264 video that every browser plays."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.files import replacing
from chmarl_pb.viewer.film import FRAME_RATE

_QUALITY = "20"  # constant rate factor of libx264; 18 is hardly told from the original


def write_video(path: Path, frames: Iterable[tuple[NDArray[np.uint8], int]], size: tuple[int, int]) -> None:
    """Write a video, whole or not at all.

    Args:
        path: the mp4 file.
        frames: pictures (height, width, 3), each with the number of frames that it stays.
        size: width and height in pixels, both even.

    Raises:
        WriteError: the disk is full.
    """
    with replacing(path) as temporary:
        writer = imageio_ffmpeg.write_frames(
            str(temporary), size, fps=FRAME_RATE, codec="libx264", pix_fmt_in="yuv420p", pix_fmt_out="yuv420p",
            macro_block_size=2, ffmpeg_log_level="quiet",
            output_params=["-crf", _QUALITY, "-preset", "veryfast", "-movflags", "+faststart", "-f", "mp4"],
        )  # fmt: skip
        writer.send(None)
        written = 0
        try:
            for picture, count in frames:
                planes = cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420)  # once for all that it stays, and fast
                for _ in range(count):
                    writer.send(planes)
                written += count
        finally:
            writer.close()
        if (found := imageio_ffmpeg.count_frames_and_secs(str(temporary))[0]) != written:  # it does not say so itself
            raise OSError(f"{path}: ffmpeg has written {found} of {written} frames")
