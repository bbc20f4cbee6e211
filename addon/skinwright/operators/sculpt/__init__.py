"""Sculpt Weights: the modal operator and what it watches."""

from . import keys, weights

MODULES = (keys, weights)
