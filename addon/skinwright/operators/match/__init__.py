"""Preview Match, and the mask that steers it."""

from . import brush_weight, edit_mask, paint_mask, preview

MODULES = (preview, edit_mask, brush_weight, paint_mask)
