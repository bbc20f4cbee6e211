"""Check Weights: what is wrong with the weights of the selected meshes, in numbers and in test poses."""

import json
from pathlib import Path

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy.types import Context, Operator

from ..scene import mesh
from ..scene.error import SceneError
from ..check.weight_check import Fault, Limits, WeightCheck, check

FAULTS = [(fault.name, fault.name.replace("_", " ").title(), f"Vertices {fault.value}") for fault in Fault]


class SKINWRIGHT_OT_check_weights(Operator):
    """Selects the offenders, so that Edit mode shows them; the pose is as before."""

    bl_idname = "skinwright.check_weights"
    bl_label = "Check Weights"
    bl_description = "Put the armature through test poses and select the vertices whose weights do badly"
    bl_options = {"REGISTER", "UNDO"}

    poses: EnumProperty(
        name="Poses",
        description="What the armature is put through",
        items=[
            ("RANGE", "Range of Motion", "Bend and twist the bones, those equally deep in the hierarchy together"),
            ("ACTION", "Keyframes", "The frames that have keys in the armature's action"),
        ],
    )
    angle: FloatProperty(
        name="Angle", description="How far bones are bent", default=np.pi / 4, min=0, max=np.pi, subtype="ANGLE"
    )
    max_influences: IntProperty(
        name="Limit", description="Most bones a vertex may follow; 0 sets no limit", default=4, min=0, soft_max=8
    )
    stretched: FloatProperty(
        name="Stretched", description="Times its length at rest from which an edge is stretched", default=2, min=1
    )
    torn: FloatProperty(
        name="Torn", description="Times its length at rest from which an edge is torn", default=4, min=1
    )
    select: EnumProperty(
        name="Select",
        description="Which offenders to select",
        items=[("ALL", "All", "Vertices with any fault"), *FAULTS],
    )
    filepath: StringProperty(
        name="Report", description="File to write the figures to as JSON; none if empty", subtype="FILE_PATH"
    )

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Cheap, as it runs on every redraw."""
        meshes = [obj for obj in context.selected_objects if obj.type == "MESH"]
        cls.poll_message_set("Select the meshes to check, in Object mode")
        return context.mode == "OBJECT" and bool(meshes)

    def execute(self, context: Context) -> set[str]:
        """Check each mesh; nothing but the selection changes."""
        body = context.scene.skinwright.transfer.source
        limits = Limits(self.max_influences, self.stretched, self.torn, poses=self.poses, angle=self.angle)
        try:
            targets = [obj for obj in context.selected_objects if obj.type == "MESH" and obj != body]
            checks = [check(obj, body, limits) for obj in targets or [context.object]]
            self._write(checks)
        except (SceneError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for result in checks:
            mesh.select(context.scene.objects[result.target], self._chosen(result))
            self.report({"WARNING" if any(result.counts().values()) else "INFO"}, result.sentence())
        return {"FINISHED"}

    def _chosen(self, result: WeightCheck):
        chosen = result.faulty.values() if self.select == "ALL" else [result.faulty[Fault[self.select]]]
        return np.logical_or.reduce(list(chosen))

    def _write(self, checks: list[WeightCheck]) -> None:
        if self.filepath:
            content = [result.to_json() for result in checks]
            Path(bpy.path.abspath(self.filepath)).write_text(json.dumps(content, indent=2) + "\n")


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_check_weights)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(SKINWRIGHT_OT_check_weights)
