"""Sculpt Weights: the modal operator and what it watches."""

from . import keys, step_pose, weights

MODULES = (keys, step_pose, weights)
