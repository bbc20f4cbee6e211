"""The overlay's legend and histograms, at the left of the view, under the view's own text and over the redo panel."""

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import ArrayLike

from ..match.session import Category
from . import colours
from .picture import Histogram, Picture

TITLES = {
    "MATCH": "Match",
    "CONFIDENCE": "Confidence",
    "INFLUENCES": "Influences",
    "STRETCH": "Stretch",
    "DIFFERENCE": "Difference",
    "FAULTS": "Faults",
}
TEXT = (0.95, 0.95, 0.95, 1.0)
BACKGROUND = (0.08, 0.08, 0.08, 0.72)
BARS_BELOW, BARS_ABOVE = (*colours.CATEGORIES[Category.MATCHED], 1.0), (*colours.CATEGORIES[Category.INPAINTED], 1.0)
LEFT, BELOW_TOP = 70, 125
LINE = 18
WIDTH = 230
HISTOGRAM_HEIGHT = 54


class _Sheet:
    """Draws in pixels at the interface's scale, from the bottom left of the legend."""

    def __init__(self, height: float) -> None:
        self.scale = bpy.context.preferences.system.ui_scale
        self.left = LEFT * self.scale
        self.bottom = bpy.context.region.height - (BELOW_TOP + height) * self.scale
        self.shader = gpu.shader.from_builtin("UNIFORM_COLOR")

    def rectangles(self, boxes: ArrayLike, colour: tuple[float, ...]) -> None:
        """Boxes (N, 4): x, y, width, height."""
        placed = np.asarray(boxes, np.float32).reshape(-1, 4) * self.scale + (self.left, self.bottom, 0, 0)
        x, y, width, height = placed.T
        corners = np.stack([x, y, x + width, y, x + width, y + height, x, y + height], axis=1).reshape(-1, 2)
        first = np.arange(len(placed), dtype=np.int64)[:, None] * 4
        triangles = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
        content = {"pos": np.ascontiguousarray(corners, np.float32)}
        batch = batch_for_shader(self.shader, "TRIS", content, indices=triangles.astype(np.int32))
        self.shader.uniform_float("color", colour)
        batch.draw(self.shader)

    def text(self, x: float, y: float, text: str) -> None:
        blf.size(0, 12 * self.scale)
        blf.color(0, *TEXT)
        blf.position(0, self.left + x * self.scale, self.bottom + y * self.scale, 0)
        blf.draw(0, text)


def draw(picture: Picture) -> None:
    """Rows of colours with counts, then histograms with their thresholds."""
    height = LINE * (len(picture.rows) + 1 + bool(picture.note)) + (HISTOGRAM_HEIGHT + LINE) * len(picture.histograms)
    sheet = _Sheet(height)
    gpu.state.blend_set("ALPHA")
    sheet.rectangles([(-8, -8, WIDTH + 16, height + 14)], BACKGROUND)
    y = 0.0
    for histogram in reversed(picture.histograms):
        y = _draw_histogram(sheet, histogram, y)
    if picture.note:
        sheet.text(0, y, picture.note)
        y += LINE
    for value, text in reversed(picture.rows):
        sheet.rectangles([(0, y, 12, 12)], (*colours.of_values(picture.kind, np.array([value]))[0], 1.0))
        sheet.text(20, y + 1, text)
        y += LINE
    sheet.text(0, y + 2, f"{TITLES[picture.kind]}: {picture.object_name}")
    gpu.state.blend_set("NONE")


def _draw_histogram(sheet: _Sheet, histogram: Histogram, y: float) -> float:
    """Gives the height above it. Bars by square root, or the few beyond the threshold could not be seen."""
    n = len(histogram.counts)
    heights = np.sqrt(histogram.counts / max(int(histogram.counts.max(initial=0)), 1)) * HISTOGRAM_HEIGHT
    width = WIDTH / n
    boxes = np.stack([np.arange(n, dtype=np.int64) * width, np.full(n, y), np.full(n, width - 0.5), heights], axis=1)
    beyond = (np.arange(n, dtype=np.int64) + 0.5) / n * histogram.high > histogram.threshold
    for colour, chosen in ((BARS_BELOW, ~beyond), (BARS_ABOVE, beyond)):
        if chosen.any():
            sheet.rectangles(boxes[chosen], colour)
    at = min(histogram.threshold / histogram.high, 1.0) * WIDTH
    sheet.rectangles([(at - 0.75, y, 1.5, HISTOGRAM_HEIGHT)], TEXT)
    sheet.text(0, y + HISTOGRAM_HEIGHT + 3, f"{histogram.label}, threshold {_with_unit(histogram)}")
    return y + HISTOGRAM_HEIGHT + LINE


def _with_unit(histogram: Histogram) -> str:
    settings = bpy.context.scene.unit_settings
    system = settings.system if histogram.unit == "LENGTH" else "METRIC"
    if system == "NONE":
        return f"{histogram.threshold:.4g}"
    value = histogram.threshold * (settings.scale_length if histogram.unit == "LENGTH" else 1.0)
    return bpy.utils.units.to_string(system, histogram.unit, value, precision=3)
