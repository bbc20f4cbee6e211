"""Panels and menus. Operators are named by bl_idname only."""

from . import menus, panel

MODULES = (panel, menus)
