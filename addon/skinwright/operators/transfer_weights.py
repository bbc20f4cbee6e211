"""Transfer Weights: from the body picked in the panel to the selected meshes."""

import bpy
from bpy.props import BoolProperty
from bpy.types import Context, Event, Object, Operator

from .. import native, preferences
from ..properties import TransferOptions
from ..scene.error import SceneError
from ..transfer import transfer_weights

MODES = {"OBJECT", "EDIT_MESH", "PAINT_WEIGHT"}


class SKINWRIGHT_OT_transfer_weights(TransferOptions, Operator):
    """The operator; all of the work is in the function it calls."""

    bl_idname = "skinwright.transfer_weights"
    bl_label = "Transfer Weights"
    bl_description = "Transfer weights from the source to the selected meshes, inpainting where they do not fit closely"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    freeze: BoolProperty(
        name="Freeze Operator",
        description="Let changes of these settings wait until this is off again, for heavy meshes",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Cheap, as it runs on every redraw."""
        reason = refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From a button or a menu: with the panel's settings."""
        settings = context.scene.skinwright.transfer
        for name in TransferOptions.__annotations__:
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(settings, name))
        return self.execute(context)

    def execute(self, context: Context) -> set[str]:
        """Transfer, and say in a line what was done or why not."""
        if self.freeze:
            self.report({"INFO"}, "Frozen: changes take effect once Freeze Operator is off")
            return {"FINISHED"}
        source = context.scene.skinwright.transfer.source
        params = self.to_params(preferences.threads(context))
        try:
            report = transfer_weights(context, source, targets(context), params)
        except (SceneError, native.NativeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for warning in report.all_warnings():
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, report.sentence())
        return {"FINISHED"}


def targets(context: Context) -> list[Object]:
    """The selected meshes but the source; while painting or editing the active one is always among them."""
    source = context.scene.skinwright.transfer.source
    meshes = [obj for obj in context.selected_objects if obj.type == "MESH"]
    active = context.active_object
    if context.mode != "OBJECT" and active and active not in meshes:
        meshes.append(active)
    return [obj for obj in meshes if obj != source]


def refusal(context: Context) -> str:
    """Why weights cannot be transferred now, or nothing."""
    if native.problem():
        return native.problem()
    if context.mode not in MODES:
        return "Go to Object, Edit or Weight Paint mode to transfer weights"
    if context.scene.skinwright.transfer.source is None:
        return "Pick the body to transfer from as Source"
    if not targets(context):
        return "Select the meshes to transfer to"
    return ""


def register() -> None:
    """Register the operator."""
    bpy.utils.register_class(SKINWRIGHT_OT_transfer_weights)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(SKINWRIGHT_OT_transfer_weights)
