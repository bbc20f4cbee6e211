"""Opens the sidebar at our tab in a file that asks for it, as the demo does: only what is drawn has tabs."""

import bpy
from bpy.app.handlers import load_post, persistent

from .panel import Tab

# A custom property of the scene.
WISH = "skinwright_show_tab"
_SECONDS, _MOST_TRIES = 0.3, 20

_tries = 0


@persistent
def _on_load(*_arguments: object) -> None:
    global _tries
    _tries = 0
    if any(WISH in scene for scene in bpy.data.scenes) and not bpy.app.background:
        bpy.app.timers.register(_show, first_interval=_SECONDS)


def _show() -> float | None:
    """Once the sidebar has been drawn."""
    global _tries
    _tries += 1
    regions = [
        (area, region)
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
        for region in area.regions
        if region.type == "UI"
    ]
    try:
        for area, region in regions:
            area.spaces.active.show_region_ui = True
            region.active_panel_category = Tab.bl_category
            area.tag_redraw()
    except (AttributeError, TypeError):
        return _SECONDS if _tries < _MOST_TRIES else None
    for scene in bpy.data.scenes:
        scene.pop(WISH, None)
    return None


def register() -> None:
    """Listen to files."""
    load_post.append(_on_load)


def unregister() -> None:
    """Stop."""
    load_post.remove(_on_load)
    if bpy.app.timers.is_registered(_show):
        bpy.app.timers.unregister(_show)
