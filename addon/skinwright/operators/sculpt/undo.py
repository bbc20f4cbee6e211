"""Sculpting weights and Blender's undo.

Each stroke leaves one of Blender's steps, which holds positions only. While the session runs, Ctrl Z is its own. At the
end those steps are taken back before the result is written, so that it is one step; where the artist has left Sculpt
mode to change the pose, that would take the pose back too, and they stay.
"""

import bpy
from bpy.types import Context, Object

MOST_STEPS = 1000


def mark(obj: Object) -> None:
    """Leave an undo step of the time before, by which the way back to it can be found."""
    obj.skinwright.sculpting = False
    bpy.ops.ed.undo_push(message="Before Sculpting Weights")
    obj.skinwright.sculpting = True
    obj.update_tag()


def take_back(context: Context, name: str) -> None:
    """Undo the brushes' own steps; the session then writes its state over that of the beginning."""
    for _ in range(MOST_STEPS):
        obj = bpy.data.objects.get(name)
        if obj is None or not obj.skinwright.sculpting or context.mode != "SCULPT" or not bpy.ops.ed.undo.poll():
            return
        bpy.ops.ed.undo()
