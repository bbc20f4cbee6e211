"""Preview Match, and the mask that steers it."""

from . import edit_mask, paint_mask, preview

MODULES = (preview, edit_mask, paint_mask)
