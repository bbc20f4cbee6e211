"""Check Weights: what is wrong with the weights of the selected meshes, in numbers and in test poses."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy.types import Context, Event

from .. import files, jobs
from ..check import shown
from ..check.params import CheckParams
from ..check.weight_check import Fault, WeightCheck, steps
from ..jobs import Jobs
from ..registration import registration
from ..scene import blend_file, mesh
from ..settings.properties import properties, values
from .base import SkinwrightOperator, selected_meshes
from .modal.long_work import LongWork

FAULTS = [(fault.name, fault.name.replace("_", " ").title(), f"Vertices {fault.value}") for fault in Fault]


class _CheckSettings:
    """The settings of a check; a mix-in."""

    __annotations__ = properties(CheckParams, ["poses", "angle", "max_influences", "stretched", "torn"])


class SKINWRIGHT_OT_check_weights(_CheckSettings, LongWork, SkinwrightOperator):
    """Nothing changes but, on demand, the selection: the overlay shows the offenders."""

    bl_idname = "skinwright.check_weights"
    bl_label = "Check Weights"
    bl_description = "Look at the weights of the selected meshes, in numbers and in test poses"
    bl_options = {"REGISTER", "UNDO"}

    select: EnumProperty(
        name="Select",
        description="Which offenders to select",
        items=[
            ("NONE", "None", "Leave the selection as it is; the overlay Faults shows the offenders"),
            ("ALL", "All", "Vertices with any fault"),
            *FAULTS,
        ],
    )
    filepath: StringProperty(
        name="Report", description="File to write the figures to as JSON; none if empty", subtype="FILE_PATH"
    )
    overwrite: BoolProperty(
        name="Overwrite", description="Let the report replace a file that is not a report", default=False
    )

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Object mode, and something to check."""
        if context.mode == "OBJECT" and selected_meshes(context):
            return ""
        return "Select the meshes to check, in Object mode"

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From a button: with a progress bar, and Esc stops it."""
        return self.attempt(lambda: self.begin(context, self._steps(context)))

    def work(self, context: Context) -> set[str]:
        """Check each mesh."""
        return self.complete(context, jobs.wait(self._steps(context)))

    def complete(self, context: Context, result: list[WeightCheck]) -> set[str]:
        """Keep the results, write the report, and say what was found."""
        shown.keep(result)
        if self.filepath:
            content = [each.to_json() for each in result]
            files.write_report(self._report_path(), content, others=blend_file.opened(), overwrite=self.overwrite)
        for each in result:
            if self.select != "NONE":
                chosen = each.any_fault() if self.select == "ALL" else each.faulty[Fault[self.select]]
                mesh.select(context.scene.objects[each.target], chosen)
            self.report({"WARNING" if any(each.counts().values()) else "INFO"}, each.sentence())
        return {"FINISHED"}

    def _steps(self, context: Context) -> Jobs[list[WeightCheck]]:
        """Refuse what can be refused at once; the rest is a generator."""
        settings = context.scene.skinwright.transfer
        if not self.properties.is_property_set("max_influences"):
            self.max_influences = settings.max_influences  # the limit is one setting
        params = CheckParams(**values(self, CheckParams))
        if self.filepath:
            files.check_output(
                self._report_path(), others=blend_file.opened(), overwrite=self.overwrite, replaces=files.REPORT
            )
        targets = selected_meshes(context, without=settings.source) or selected_meshes(context)
        return _one_by_one([(target, settings.source, params) for target in targets])

    def _report_path(self) -> Path:
        return Path(bpy.path.abspath(self.filepath))


def _one_by_one(inputs: list[tuple]) -> Jobs[list[WeightCheck]]:
    results = []
    for each in inputs:
        results.append((yield from steps(*each)))
    return results


class SKINWRIGHT_OT_show_worst_pose(SkinwrightOperator):
    """Puts the armature into the pose; undo brings the old one back."""

    bl_idname = "skinwright.show_worst_pose"
    bl_label = "Show Worst Pose"
    bl_description = "Put the armature into the test pose with the most faults of the active mesh"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """A mesh that was checked, with a fault in some pose."""
        result = shown.of(context.object)
        return "" if result and result.worst else "Check the weights of the active mesh first"

    def work(self, context: Context) -> set[str]:
        """Pose it, and name the pose."""
        return self.tell(f"{context.object.name}: {shown.take_worst_pose(context.object)}", [])


register, unregister = registration(SKINWRIGHT_OT_check_weights, SKINWRIGHT_OT_show_worst_pose)
