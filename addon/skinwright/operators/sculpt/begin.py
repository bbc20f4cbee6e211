"""How Sculpt Weights begins: why it may not, and going to Sculpt mode."""

import bpy
from bpy.types import Context

from ... import native, preferences
from ...scene import sculpting
from ...sculpt import session as sculpt_session
from ...sculpt.session import SculptSession
from . import undo as sculpt_undo


def refusal(context: Context) -> str:
    """Why weights cannot be sculpted now, or nothing."""
    if native.problem():
        return native.problem()
    if sculpt_session.current:
        return "Weights are being sculpted"
    if context.mode not in {"OBJECT", "SCULPT"}:
        return "Go to Object or Sculpt mode to sculpt weights"
    if context.object is None or context.object.type != "MESH":
        return "Make the skinned mesh the active object"
    return ""


def begin(context: Context) -> SculptSession:
    """A session of the active mesh, in Sculpt mode.

    Raises SceneError or native.NativeError with the scene as it was, but perhaps in Sculpt mode.
    """
    obj = context.object
    sculpting.check(obj)
    go_to(context, "SCULPT")
    sculpt_undo.mark(obj)
    return SculptSession(obj, context.scene.skinwright.sculpt.to_options(preferences.threads(context)))


def go_to(context: Context, mode: str) -> None:
    """Change the mode, if it is another."""
    if context.object.mode != mode:
        bpy.ops.object.mode_set(mode=mode)
