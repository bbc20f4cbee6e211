"""Embed Armature: the skeleton of another character into the selected meshes."""

from bpy.types import Context, Event, Object

from .. import jobs, preferences
from ..embed import EmbedReport, steps
from ..registration import registration
from ..scene import armature
from ..settings.embed import EmbedSettings
from ..settings.properties import last_used
from .base import SkinwrightOperator, passed_over, refusal_in_mode, selected_meshes
from .modal.long_work import LongWork

# Below this the work takes less than the blink of a progress bar.
LONG_WORK_VERTICES = 2_000


class SKINWRIGHT_OT_embed_armature(LongWork, EmbedSettings, SkinwrightOperator):
    """The operator; all of the work is in the function it calls."""

    bl_idname = "skinwright.embed_armature"
    bl_label = "Embed Armature"
    bl_description = "Put a copy of the source's armature into the selected meshes, every joint where it belongs"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Mode, source and targets."""
        found = refusal_in_mode(context, "embed an armature")
        if found:
            return found
        if context.mode != "OBJECT":
            return "Go to Object mode to embed an armature"
        if context.scene.skinwright.retarget.source is None:
            return "Pick the armature of another character as Source of Retarget Weights"
        return "" if targets(context) else "Select the meshes that shall get an armature"

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From a button or a menu: with the panel's settings."""
        settings = context.scene.skinwright.embed
        for name in EmbedSettings.__annotations__:
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(settings, name))
        if sum(len(obj.data.vertices) for obj in targets(context)) < LONG_WORK_VERTICES:
            return self.execute(context)
        return self.attempt(lambda: self.begin(context, self._steps(context)))

    def work(self, context: Context) -> set[str]:
        """Embed, and say in a line what was done."""
        return self.complete(context, jobs.wait(self._steps(context)))

    def complete(self, context: Context, report: EmbedReport) -> set[str]:
        """Say what was done, and leave what it was done with to the panel."""
        last_used(self.properties, context.scene.skinwright.embed, EmbedSettings.__annotations__)
        return self.tell(report.sentence(), [*report.all_warnings(), *passed_over(context)])

    def _steps(self, context: Context) -> jobs.Jobs[EmbedReport]:
        params = self.to_params(preferences.threads(context))
        return steps(context, context.scene.skinwright.retarget.source, targets(context), params)


def targets(context: Context) -> list[Object]:
    """The selected meshes that the source does not deform."""
    source = context.scene.skinwright.retarget.source
    return [obj for obj in selected_meshes(context) if source is None or armature.find(obj) != source]


register, unregister = registration(SKINWRIGHT_OT_embed_armature)
