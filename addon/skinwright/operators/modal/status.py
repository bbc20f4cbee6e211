"""The line in the status bar, and the sidebar that shows the same."""

import bpy
from bpy.types import Context

# Names of the workspaces whose line is ours.
_shown: set[str] = set()


def show(context: Context, text: str) -> None:
    """In the present workspace."""
    if context.workspace:
        context.workspace.status_text_set(text)
        _shown.add(context.workspace.name)
    redraw_sidebars()


def clear() -> None:
    """In every workspace that has our line."""
    while _shown:
        workspace = bpy.data.workspaces.get(_shown.pop())
        if workspace:
            workspace.status_text_set(None)
    redraw_sidebars()


def redraw_sidebars() -> None:
    """What has changed in the view itself Blender sees without being told."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in (region for region in area.regions if region.type == "UI"):
                    region.tag_redraw()
