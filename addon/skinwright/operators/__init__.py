"""Operators, one family a file."""

from . import (
    check_weights,
    desparsify,
    edit_match_mask,
    paint_match_mask,
    presets,
    preview_match,
    sculpt_weights,
    transfer_weights,
)

MODULES = (
    transfer_weights,
    presets,
    preview_match,
    edit_match_mask,
    paint_match_mask,
    check_weights,
    desparsify,
    sculpt_weights,
)
