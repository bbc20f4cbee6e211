"""Transfer Weights: from the source picked in the panel to the selected meshes."""

from bpy.props import BoolProperty
from bpy.types import Context, Event, Object

from .. import jobs, preferences
from ..registration import registration
from ..reporting import Report
from ..settings import TransferSettings
from ..settings.properties import last_used
from ..transfer import TransferParams, steps
from ..transfer.params import means_thresholds
from .base import SkinwrightOperator, passed_over, refusal_in_mode, selected_meshes
from .comparison import compared
from .modal.long_work import LongWork

# Below this a transfer takes less than the blink of a progress bar.
LONG_WORK_VERTICES = 50_000


class SKINWRIGHT_OT_transfer_weights(LongWork, TransferSettings, SkinwrightOperator):
    """The operator; all of the work is in the function it calls."""

    bl_idname = "skinwright.transfer_weights"
    bl_label = "Transfer Weights"
    bl_description = "Transfer weights from the source to the selected meshes, inpainting where they do not fit closely"
    # No PRESET: there is one list of presets, that of the panel.
    bl_options = {"REGISTER", "UNDO"}

    freeze: BoolProperty(
        name="Freeze Operator",
        description="Let changes of these settings wait until this is off again, for heavy meshes",
        default=False,
        options={"SKIP_SAVE"},
    )

    compare: BoolProperty(
        name="Check Before and After",
        description="Count stretched, torn and opened vertices in test poses before and after, and report both",
        default=False,
    )

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Mode, source and targets."""
        return refusal(context)

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From a button or a menu: with the panel's settings."""
        settings = context.scene.skinwright.transfer
        for name in TransferSettings.__annotations__:
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(settings, name))
        vertices = sum(len(target.data.vertices) for target in targets(context))
        if vertices < LONG_WORK_VERTICES or self.freeze:
            return self.execute(context)
        return self.attempt(lambda: self.begin(context, self._steps(context)))

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
        layout.prop(self, "compare")
        layout.prop(self, "freeze")

    def work(self, context: Context) -> set[str]:
        """Transfer, and say in a line what was done."""
        if self.freeze:
            self.report({"INFO"}, "Frozen: changes take effect once Freeze Operator is off")
            return {"FINISHED"}
        return self.complete(context, jobs.wait(self._steps(context)))

    def complete(self, context: Context, report: Report) -> set[str]:
        """Say what was done, and leave what it was done with to the panel, the preview, the mask and the check."""
        last_used(self.properties, context.scene.skinwright.transfer, TransferSettings.__annotations__)
        return self.tell(report.sentence(), [*report.all_warnings(), *passed_over(context)])

    def _steps(self, context: Context) -> jobs.Jobs[Report]:
        inputs = self._inputs(context)
        _, source, chosen, params = inputs
        transfer = steps(*inputs, before_write=self.keep_before)
        return compared(transfer, source, chosen, params.max_influences) if self.compare else transfer

    def _inputs(self, context: Context) -> tuple[Context, Object, list[Object], TransferParams]:
        if means_thresholds(filter(self.properties.is_property_set, TransferSettings.__annotations__)):
            self.method = "PAPER"  # as a script means that was written for it
        params = self.to_params(preferences.threads(context))
        return context, context.scene.skinwright.transfer.source, targets(context), params


def targets(context: Context) -> list[Object]:
    """The selected meshes without the source."""
    return selected_meshes(context, without=context.scene.skinwright.transfer.source)


def refusal(context: Context) -> str:
    """Why weights cannot be transferred now, or nothing."""
    found = refusal_in_mode(context, "transfer weights")
    if found:
        return found
    if context.scene.skinwright.transfer.source is None:
        return "Pick the body to transfer from as Source"
    return "" if targets(context) else "Select the meshes to transfer to"


register, unregister = registration(SKINWRIGHT_OT_transfer_weights)
