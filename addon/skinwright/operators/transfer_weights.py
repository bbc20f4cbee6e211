"""Transfer Weights: from the body picked in the panel to the selected meshes."""

import bpy
from bpy.props import BoolProperty
from bpy.types import Context, Event, Object

from .. import native, preferences
from ..settings import TransferOptions
from ..reporting import Report
from ..scene.error import SceneError
from ..transfer import TransferParams, steps, transfer_weights
from .modal.long_work import LongWork

MODES = {"OBJECT", "EDIT_MESH", "PAINT_WEIGHT"}
# Below this a transfer takes less than the blink of a progress bar.
LONG_WORK_VERTICES = 50_000


class SKINWRIGHT_OT_transfer_weights(LongWork, TransferOptions):
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
        vertices = sum(len(target.data.vertices) for target in targets(context))
        if vertices < LONG_WORK_VERTICES or self.freeze:
            return self.execute(context)
        return self.begin(context, steps(*self._inputs(context)))

    def draw(self, _context: Context) -> None:
        """The redo panel."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "groups")
        for draw in (self.draw_matching, self.draw_inpainting, self.draw_writing):
            layout.separator()
            draw(layout.column())
        layout.separator()
        layout.prop(self, "freeze")

    def execute(self, context: Context) -> set[str]:
        """Transfer, and say in a line what was done or why not."""
        if self.freeze:
            self.report({"INFO"}, "Frozen: changes take effect once Freeze Operator is off")
            return {"FINISHED"}
        try:
            report = transfer_weights(*self._inputs(context))
        except (SceneError, native.NativeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self.complete(context, report)

    def complete(self, _context: Context, report: Report) -> set[str]:
        """Say what was done."""
        self.report({"INFO"}, report.sentence())
        for warning in report.all_warnings():  # last, as the status bar shows the last
            self.report({"WARNING"}, warning)
        return {"FINISHED"}

    def _inputs(self, context: Context) -> tuple[Context, Object, list[Object], TransferParams]:
        params = self.to_params(preferences.threads(context))
        return context, context.scene.skinwright.transfer.source, targets(context), params


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
