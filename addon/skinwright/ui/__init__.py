"""Panels and menus. Operators are named by bl_idname only."""

from . import match_panel, menus, panel, sculpt_panel, stored_panel

MODULES = (panel, match_panel, sculpt_panel, stored_panel, menus)
