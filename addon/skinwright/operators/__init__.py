"""Operators, one family a file."""

from . import (
    check_weights,
    desparsify,
    edit_match_mask,
    paint_match_mask,
    presets,
    preview_match,
    sculpt_keys,
    sculpt_weights,
    timers,
    transfer_weights,
)

MODULES = (
    timers,
    transfer_weights,
    presets,
    preview_match,
    edit_match_mask,
    paint_match_mask,
    check_weights,
    desparsify,
    sculpt_keys,
    sculpt_weights,
)
