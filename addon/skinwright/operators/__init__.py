"""Operators, one file or folder per feature."""

from . import check_weights, desparsify, match, presets, sculpt, stored_weights, transfer_weights
from .modal import timers

MODULES = (
    timers,
    transfer_weights,
    presets,
    *match.MODULES,
    check_weights,
    desparsify,
    *sculpt.MODULES,
    stored_weights,
)
