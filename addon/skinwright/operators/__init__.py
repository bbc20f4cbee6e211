"""Operators, one family a file."""

from . import presets, transfer_weights

MODULES = (transfer_weights, presets)
