"""Writes frames as an H.264 video that every browser plays."""

from collections.abc import Iterable
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.demo.film import FRAME_RATE
from chmarl_pb.files import replacing

_QUALITY = "20"  # constant rate factor of libx264; 18 is hardly told from the original


def write_video(path: Path, frames: Iterable[tuple[NDArray[np.uint8], int]], size: tuple[int, int]) -> None:
    """Write a video.

    Args:
        path: the mp4 file.
        frames: pictures (height, width, 3), each with the number of frames that it stays.
        size: width and height in pixels, both even.
    """
    with replacing(path) as temporary:
        writer = imageio_ffmpeg.write_frames(
            str(temporary), size, fps=FRAME_RATE, codec="libx264", pix_fmt_in="rgb24", pix_fmt_out="yuv420p",
            macro_block_size=2, ffmpeg_log_level="error",
            output_params=["-crf", _QUALITY, "-preset", "veryfast", "-movflags", "+faststart", "-f", "mp4"],
        )  # fmt: skip
        writer.send(None)
        try:
            for picture, count in frames:
                for _ in range(count):
                    writer.send(np.ascontiguousarray(picture))
        finally:
            writer.close()
