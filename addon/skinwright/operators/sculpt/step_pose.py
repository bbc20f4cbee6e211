"""Stepping through the poses of the armature without leaving the brush."""

from bpy.props import IntProperty
from bpy.types import Context, Object

from ...registration import registration
from ...scene import armature, poses
from ...scene.error import SceneError
from ..base import SkinwrightOperator


class SKINWRIGHT_OT_step_pose(SkinwrightOperator):
    """The keys of the armature's action are the artist's poses."""

    bl_idname = "skinwright.step_pose"
    bl_label = "Step Pose"
    bl_description = "Go to the next or previous frame in which the armature has keys"
    bl_options = {"REGISTER"}

    step: IntProperty(name="Step", description="Keyed frames to go on by", default=1)

    @classmethod
    def refusal(cls, context: Context) -> str:
        """A mesh on an armature, or the armature."""
        return "" if _rig(context) else "Make a mesh with an armature the active object"

    def work(self, context: Context) -> set[str]:
        """Around from the last to the first."""
        rig = _rig(context)
        assert rig is not None  # `refusal` has seen it
        frames = poses.keyed_frames(rig)
        if not frames:
            raise SceneError(f"{rig.name} has no keyframes to step through: key the poses in an action")
        now = context.scene.frame_current
        ahead = [frame for frame in frames if frame > now] or frames
        behind = [frame for frame in frames if frame < now] or frames
        context.scene.frame_set(ahead[0] if self.step > 0 else behind[-1])
        return {"FINISHED"}


def _rig(context: Context) -> Object | None:
    obj = context.object
    if obj is None or obj.type == "ARMATURE":
        return obj
    return armature.find(obj) if obj.type == "MESH" else None


register, unregister = registration(SKINWRIGHT_OT_step_pose)
