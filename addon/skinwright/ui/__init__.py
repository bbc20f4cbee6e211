"""Panels and menus. Operators are named by bl_idname only."""

from . import match_panel, menus, overlay, panel

MODULES = (panel, match_panel, menus, overlay)
