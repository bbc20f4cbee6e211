"""Bake Correctives and Remove Correctives: refinement as driven shape keys, for engines and other packages."""

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy.types import Context, Event

from ... import files, jobs, preferences
from ...refine import correctives
from ...registration import registration
from ...scene import blend_file
from ...settings.refine import CorrectiveSettings, adopt
from ..base import SkinwrightOperator
from ..modal.long_work import LongWork
from .targets import chosen_joints, found, refusal


class SKINWRIGHT_OT_bake_correctives(LongWork, CorrectiveSettings, SkinwrightOperator):
    """Samples the joints, solves them and writes keys with drivers."""

    bl_idname = "skinwright.bake_correctives"
    bl_label = "Bake Correctives"
    bl_description = "Sample the selected bones' joints (all in Object mode) and bake refined skin to driven shape keys"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(
        name="Certificate",
        description="File to write the figures of every key to as JSON; none if empty",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Mode and target."""
        return refusal(context, "bake correctives")

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From the panel: with its settings, and progress."""
        adopt(self, context.scene.skinwright.refine, CorrectiveSettings)
        return self.attempt(lambda: self.begin(context, self._steps(context)))

    def work(self, context: Context) -> set[str]:
        """From a script: wait."""
        return self.complete(context, jobs.wait(self._steps(context)))

    def complete(self, _context: Context, report: correctives.CorrectiveReport) -> set[str]:
        """Say what was done."""
        return self.tell(report.sentence(), report.all_warnings())

    def _steps(self, context: Context) -> "jobs.Jobs[correctives.CorrectiveReport]":
        obj = found(context)
        params = self.to_params(preferences.threads(context))
        if self.filepath:
            files.check_output(self._certificate(), others=blend_file.opened(), replaces=files.REPORT)
        return correctives.steps(obj, params, chosen_joints(context, obj), self._certify if self.filepath else None)

    def _certify(self, report: correctives.CorrectiveReport) -> None:
        files.write_report(self._certificate(), report.to_json(), others=blend_file.opened())

    def _certificate(self) -> Path:
        return Path(bpy.path.abspath(self.filepath))


class SKINWRIGHT_OT_remove_correctives(SkinwrightOperator):
    """Everything that Bake Correctives added goes."""

    bl_idname = "skinwright.remove_correctives"
    bl_label = "Remove Correctives"
    bl_description = "Remove the baked corrective keys and their drivers"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Only where there are some."""
        reason = refusal(context, "remove correctives")
        return reason or ("" if correctives.baked(found(context)) else "There are no baked correctives on this mesh")

    def work(self, context: Context) -> set[str]:
        """Remove and say how many."""
        obj = found(context)
        return self.tell(f"{obj.name}: {correctives.remove(obj)} corrective keys removed", [])


register, unregister = registration(SKINWRIGHT_OT_bake_correctives, SKINWRIGHT_OT_remove_correctives)
