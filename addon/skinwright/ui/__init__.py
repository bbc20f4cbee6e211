"""Panels and menus. Operators are named by bl_idname only."""

from . import (
    match_panel,
    menus,
    panel,
    refine_panel,
    result_panel,
    retarget_panel,
    sculpt_panel,
    session_panel,
    show_tab,
    stored_panel,
)

MODULES = (
    panel,
    session_panel,
    result_panel,
    match_panel,
    sculpt_panel,
    stored_panel,
    retarget_panel,
    refine_panel,
    menus,
    show_tab,
)
