"""Raw signals as small pictures for the page: dark is nothing, bright is most, red is dead."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from estimator.vectors import Array, frozen

WIDTH = 132  # pixels of a picture on the page
# of the colours from dark to bright: matplotlib's viridis at equal steps
_RAMP = np.array(
    [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129],
     [92, 200, 99], [170, 220, 50], [253, 231, 37]], dtype=np.float64,
)  # fmt: skip
_DEAD = np.array([190, 30, 45], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Signal:
    """A raw signal as it is shown.

    Args:
        values: Rows and columns, NaN where a tactel or pixel is dead.
        words: What its brightest place means, such as "0.74 mm deep".
    Raises:
        ValueError: Not a table of numbers.
    """

    values: Array
    words: str = ""

    def __post_init__(self) -> None:
        values = frozen(self.values)
        if values.ndim != 2 or values.size == 0:
            raise ValueError(f"signal: expected rows and columns, got shape {values.shape}")
        object.__setattr__(self, "values", values)


def picture(signal: Signal) -> str:
    """The signal as a PNG in a data address; tactels as squares, images as they are."""
    rows, columns = signal.values.shape
    coloured = Image.fromarray(_coloured(signal.values))
    scale = max(1, round(WIDTH / columns))
    file = io.BytesIO()
    coloured.resize((columns * scale, rows * scale), Image.Resampling.NEAREST).save(file, "PNG")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode("ascii")


def _coloured(values: Array) -> NDArray[np.uint8]:
    """Red, green and blue of every value, (rows, columns, 3)."""
    dead = ~np.isfinite(values)
    known = np.where(dead, 0.0, values)
    low, high = min(float(known.min()), 0.0), float(known.max())
    level = (known - low) / max(high - low, 1e-300)
    steps = np.linspace(0.0, 1.0, len(_RAMP))
    channels = [np.interp(level, steps, _RAMP[:, k]) for k in range(3)]
    image = np.stack(channels, axis=-1)
    image[dead] = _DEAD
    return np.asarray(np.round(image), dtype=np.uint8)
