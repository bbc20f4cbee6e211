"""Refinement: corrective keys, cached actions, the live preview."""

from . import bake_cache, bake_correctives, live_refine

MODULES = (bake_correctives, bake_cache, live_refine)
