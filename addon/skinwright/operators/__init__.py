"""Operators, one file or folder per feature."""

from . import (
    automatic_weights,
    bone_map,
    check_weights,
    desparsify,
    embed_armature,
    landmarks,
    match,
    panel_buttons,
    presets,
    refine,
    retarget_weights,
    sculpt,
    stored_weights,
    transfer_weights,
)
from .modal import keep_alive, long_work, timers, undo

MODULES = (
    timers,
    long_work,
    keep_alive,
    undo,
    transfer_weights,
    presets,
    *match.MODULES,
    check_weights,
    automatic_weights,
    desparsify,
    *sculpt.MODULES,
    *refine.MODULES,
    stored_weights,
    panel_buttons,
    retarget_weights,
    bone_map,
    landmarks,
    embed_armature,
)
