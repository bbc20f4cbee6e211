"""Desparsify Weights: bones to choose from for every vertex of the selected meshes."""

import bpy
from bpy.types import Context, Object, Operator

from .. import native, preferences
from ..desparsify import desparsify
from ..scene import mesh
from ..scene.error import SceneError
from ..settings.sculpt import DesparsifyOptions

MODES = {"OBJECT", "EDIT_MESH", "PAINT_WEIGHT"}


class SKINWRIGHT_OT_desparsify(DesparsifyOptions, Operator):
    """The operator; all of the work is in the function it calls."""

    bl_idname = "skinwright.desparsify"
    bl_label = "Desparsify Weights"
    bl_description = "Give every vertex the same number of bones to choose from, the new ones with weight 0"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Cheap, as it runs on every redraw."""
        reason = _refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def execute(self, context: Context) -> set[str]:
        """Each mesh by itself; those done stay done where another is refused."""
        params = self.to_params(preferences.threads(context))
        done = False
        with mesh.object_mode(context):
            for obj in _targets(context):
                try:
                    report = desparsify(obj, params)
                except (SceneError, native.NativeError) as error:
                    self.report({"WARNING" if done else "ERROR"}, str(error))
                    return {"FINISHED" if done else "CANCELLED"}
                self.report({"INFO"}, report.sentence())
                done = True
        return {"FINISHED"}


def _targets(context: Context) -> list[Object]:
    """The active mesh first, so that its problem is the first one told; outside Object mode it alone."""
    active = context.active_object
    meshes = [obj for obj in context.selected_objects if obj.type == "MESH" and obj != active]
    first = [active] if active and active.type == "MESH" else []
    return first + meshes if context.mode == "OBJECT" else first


def _refusal(context: Context) -> str:
    if native.problem():
        return native.problem()
    if context.mode not in MODES:
        return "Go to Object, Edit or Weight Paint mode to desparsify weights"
    return "" if _targets(context) else "Select the meshes to desparsify"


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_desparsify)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(SKINWRIGHT_OT_desparsify)
