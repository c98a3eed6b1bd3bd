"""Colours as colour-blind readers see them, and how far apart two of them are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: What dichromats see, for linear RGB: Machado et al., IEEE TVCG 15 (2009), table of severity 1.
EYES = {
    "usual": np.eye(3),
    "protanope": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                  [-0.003882, -0.048116, 1.051998]],
    "deuteranope": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                    [-0.011820, 0.042940, 0.968881]],
}  # fmt: skip

#: Linear sRGB to XYZ under D65 (IEC 61966-2-1), and the white point.
TO_XYZ = [
    [0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
]  # fmt: skip
WHITE = (0.95047, 1.0, 1.08883)


def rgb(colour: str) -> list[int]:
    """The channels of a colour such as "#0072B2", 0 … 255."""
    return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]


def lab(colour: str, eyes: str = "usual") -> npt.NDArray[np.float64]:
    """A colour in CIELAB (D65) as these eyes see it, shape (3,)."""
    values = np.array(rgb(colour)) / 255.0
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    xyz = np.array(TO_XYZ) @ np.clip(EYES[eyes] @ linear, 0.0, 1.0) / WHITE
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def apart(one: str, other: str, eyes: str = "usual") -> float:
    """The difference ΔE of two colours to these eyes, by CIE76: their distance in CIELAB."""
    return float(np.linalg.norm(lab(one, eyes) - lab(other, eyes)))
