"""Automatic Weights: from the bones of an armature to the selected meshes, from scratch."""

from bpy.types import Context, Event, Object

from .. import jobs, preferences
from ..autoskin import steps
from ..registration import registration
from ..reporting import AutoskinReport
from ..scene import mesh
from ..scene.error import SceneError
from ..settings.autoskin import AutoskinSettings
from .base import SkinwrightOperator, passed_over, refusal_in_mode, selected_meshes
from .modal.long_work import LongWork

# Below this the work takes less than the blink of a progress bar.
LONG_WORK_VERTICES = 10_000


class SKINWRIGHT_OT_automatic_weights(LongWork, AutoskinSettings, SkinwrightOperator):
    """The operator; all of the work is in the function it calls."""

    bl_idname = "skinwright.automatic_weights"
    bl_label = "Automatic Weights"
    bl_description = "Compute weights of the selected meshes for the bones of their armature, on any kind of mesh"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Modes and targets."""
        found = refusal_in_mode(context, "compute weights")
        return found or ("" if selected_meshes(context) else "Select the meshes to compute weights for")

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From a button or a menu: with a progress bar where it takes long."""
        vertices = sum(len(obj.data.vertices) for obj in selected_meshes(context))
        if vertices < LONG_WORK_VERTICES or context.mode == "EDIT_MESH":
            return self.execute(context)
        return self.attempt(lambda: self.begin(context, self._steps(context)))

    def work(self, context: Context) -> set[str]:
        """All meshes, or none where one is refused."""
        with mesh.object_mode(context):
            return self.complete(context, jobs.wait(self._steps(context)))

    def complete(self, context: Context, report: AutoskinReport) -> set[str]:
        """Say what was done, and what is worth a look."""
        return self.tell(report.sentence(), [*report.all_warnings(), *passed_over(context)])

    def _steps(self, context: Context) -> jobs.Jobs[AutoskinReport]:
        params = self.to_params(preferences.threads(context))
        return steps(selected_meshes(context), _armature(context), params, before_write=self.keep_before)


def _armature(context: Context) -> Object | None:
    """The selected armature, as in Blender's own parenting; without one each mesh has its own."""
    active = context.active_object
    if active and active.type == "ARMATURE":
        return active
    rigs = [obj for obj in context.selected_objects if obj.type == "ARMATURE"]
    if len(rigs) > 1:
        names = " and ".join(rig.name for rig in rigs)
        raise SceneError(f"{names} are selected: make the armature whose bones count the active object")
    return rigs[0] if rigs else None


register, unregister = registration(SKINWRIGHT_OT_automatic_weights)
