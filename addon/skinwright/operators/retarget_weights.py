"""Retarget Weights: from the character picked in the panel to the selected meshes of another."""

from bpy.types import Context, Event, Object

from .. import jobs, preferences
from ..registration import registration
from ..retarget import RetargetReport, steps
from ..scene import armature, attributes, mesh
from ..settings.properties import last_used
from ..settings.retarget import RetargetSettings
from .base import SkinwrightOperator, passed_over, refusal_in_mode, selected_meshes
from .modal.long_work import LongWork

# Below this a retargeting takes less than the blink of a progress bar.
LONG_WORK_VERTICES = 5_000


class SKINWRIGHT_OT_retarget_weights(LongWork, RetargetSettings, SkinwrightOperator):
    """The operator; all of the work is in the function it calls."""

    bl_idname = "skinwright.retarget_weights"
    bl_label = "Retarget Weights"
    bl_description = "Take the weights of another character with a similar skeleton, whatever its pose and proportions"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Mode, source and targets."""
        return refusal(context)

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From a button or a menu: with the panel's settings."""
        settings = context.scene.skinwright.retarget
        for name in RetargetSettings.__annotations__:
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(settings, name))
        vertices = sum(len(obj.data.vertices) for obj in targets(context))
        if vertices < LONG_WORK_VERTICES or context.mode == "EDIT_MESH":
            return self.execute(context)
        return self.attempt(lambda: self.begin(context, self._steps(context)))

    def draw(self, _context: Context) -> None:
        """The redo panel."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.draw_settings(self.layout)

    def work(self, context: Context) -> set[str]:
        """Retarget, and say in a line what was done."""
        with mesh.object_mode(context):
            return self.complete(context, jobs.wait(self._steps(context)))

    def complete(self, context: Context, report: RetargetReport) -> set[str]:
        """Say what was done, and leave what it was done with to the panel."""
        if self.show_correspondence:
            attributes.show_colors(context.area)
        last_used(self.properties, context.scene.skinwright.retarget, RetargetSettings.__annotations__)
        return self.tell(report.sentence(), [*report.all_warnings(), *passed_over(context)])

    def _steps(self, context: Context) -> jobs.Jobs[RetargetReport]:
        settings, chosen = context.scene.skinwright.retarget, targets(context)
        params = self.to_params(preferences.threads(context), settings.given_landmarks())

        def map_of(rig: Object) -> dict[str, str]:
            return settings.given_map(settings.source, rig)

        return steps(context, settings.source, chosen, params, self.keep_before, map_of)


def targets(context: Context) -> list[Object]:
    """The selected meshes that the source's armature does not deform."""
    source = context.scene.skinwright.retarget.source
    return [obj for obj in selected_meshes(context) if source is None or armature.find(obj) != source]


def refusal(context: Context) -> str:
    """Why weights cannot be retargeted now, or nothing."""
    found = refusal_in_mode(context, "retarget weights")
    if found:
        return found
    if context.scene.skinwright.retarget.source is None:
        return "Pick the armature of the character to take weights from as Source"
    return "" if targets(context) else "Select the meshes of the character that shall get weights"


register, unregister = registration(SKINWRIGHT_OT_retarget_weights)
