"""Frames into files: GIF and MP4.

Frames are images of one size that arrive one by one; only the previous one is kept in memory.
"""

from __future__ import annotations

import shutil
import struct
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import GifImagePlugin
from PIL.Image import Dither, Image, Quantize, fromarray

from figures.style import suffix_of
from minisim.errors import FileError, MissingExtraError
from minisim.files import AnyPath

FORMATS = ("gif", "mp4")

Indices = npt.NDArray[np.uint8]

#: Frames per second of a GIF at most: viewers show a delay below 0.02 s as 0.1 s.
GIF_FPS = 50.0

#: Colours of an indexed frame; one more index is transparent and means "as before".
COLOURS = 127


def animation_format(path: AnyPath) -> str:
    """The suffix as one of `FORMATS`; .mp4 without ffmpeg raises `MissingExtraError`."""
    suffix = suffix_of(path, "an animation", FORMATS)
    if suffix == "mp4" and shutil.which("ffmpeg") is None:
        lacking = "an .mp4 needs the program ffmpeg, which was not found"
        raise MissingExtraError(f"{lacking}; install it, or write a .gif or a page (.html)")
    return suffix


def palette_of(frame: Image) -> Image:
    """An indexed image with the colours of `frame`, for indexing other frames."""
    return frame.quantize(COLOURS, method=Quantize.MEDIANCUT)


def write_gif(frames: Iterator[Image], palette: Image, path: Path, fps: float) -> None:
    """Write a GIF that loops forever.

    Each frame holds only the rectangle that changed; pixels in it that did not are transparent
    (GIF89a, §18 screen, §20 image, §23 control; the loop is Netscape's extension). Delays are whole
    hundredths of a second, chosen so that no frame is late by more than half of one.
    """
    size_code = COLOURS.bit_length() - 1
    shown: Indices | None = None
    with path.open("wb") as file:
        file.write(b"GIF89a" + struct.pack("<HHBBB", *palette.size, 0x80 | size_code, 0, 0))
        file.write(_colours(palette) + b"!\xff\x0bNETSCAPE2.0\x03\x01\0\0\0")
        for k, frame in enumerate(frames):
            delay = round(100.0 * (k + 1) / fps) - round(100.0 * k / fps)
            indices = _indexed(frame, palette)
            corner, part = _changed(indices, shown)
            shown_for = {"duration": 10 * delay, "transparency": COLOURS, "disposal": 1}
            file.write(b"".join(GifImagePlugin.getdata(fromarray(part, "P"), corner, **shown_for)))
            shown = indices
        file.write(b";")


def write_mp4(frames: Iterator[Image], path: Path, fps: float) -> None:
    """Pipe the frames into ffmpeg; raises `FileError` with ffmpeg's own message if it fails."""
    first = next(frames)
    command = [
        "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{first.width}x{first.height}", "-r", f"{fps:g}", "-i", "-", "-an",
        "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(path),
    ]  # fmt: skip
    with (
        tempfile.TemporaryFile() as log,
        subprocess.Popen(command, stdin=subprocess.PIPE, stderr=log) as encoder,
    ):
        assert encoder.stdin is not None
        with suppress(BrokenPipeError), encoder.stdin as pipe:  # ffmpeg gave up: see its exit code
            for frame in chain([first], frames):
                pipe.write(frame.tobytes())
        if encoder.wait() != 0:
            log.seek(0)
            reason = " ".join(log.read().decode(errors="replace").split())
            raise FileError(f"ffmpeg could not write the animation: {reason}")


def _indexed(frame: Image, palette: Image) -> Indices:
    return np.asarray(frame.quantize(palette=palette, dither=Dither.NONE))


def _colours(palette: Image) -> bytes:
    """Red, green and blue of every index, including the transparent one."""
    return bytes(palette.getpalette() or ())[: 3 * COLOURS].ljust(3 * (COLOURS + 1), b"\0")


def _changed(indices: Indices, shown: Indices | None) -> tuple[tuple[int, int], Indices]:
    """Corner (x, y) and content of the smallest rectangle that turns `shown` into `indices`."""
    if shown is None:
        return (0, 0), indices
    differs = indices != shown
    rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
    if not len(rows):
        return (0, 0), np.full((1, 1), COLOURS, dtype=np.uint8)
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    part = np.where(differs[box], indices[box], COLOURS).astype(np.uint8)
    return (int(columns[0]), int(rows[0])), part
