"""Check Weights: what is wrong with the weights of the selected meshes, in numbers and in test poses."""

from pathlib import Path

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy.types import Context

from .. import files
from ..check.params import CheckParams
from ..check.weight_check import Fault, WeightCheck, check
from ..registration import registration
from ..scene import mesh
from ..settings.properties import properties, values
from .base import SkinwrightOperator, selected_meshes

FAULTS = [(fault.name, fault.name.replace("_", " ").title(), f"Vertices {fault.value}") for fault in Fault]


class _CheckSettings:
    """The settings of a check; a mix-in."""

    __annotations__ = properties(CheckParams, ["poses", "angle", "max_influences", "stretched", "torn"])


class SKINWRIGHT_OT_check_weights(_CheckSettings, SkinwrightOperator):
    """Selects the offenders, so that Edit mode shows them; the pose is as before."""

    bl_idname = "skinwright.check_weights"
    bl_label = "Check Weights"
    bl_description = "Put the armature through test poses and select the vertices whose weights do badly"
    bl_options = {"REGISTER", "UNDO"}

    select: EnumProperty(
        name="Select",
        description="Which offenders to select",
        items=[("ALL", "All", "Vertices with any fault"), *FAULTS],
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

    def work(self, context: Context) -> set[str]:
        """Check each mesh; nothing but the selection changes."""
        settings = context.scene.skinwright.transfer
        if not self.properties.is_property_set("max_influences"):
            self.max_influences = settings.max_influences  # the limit is one setting
        params = CheckParams(**values(self, CheckParams))
        report = Path(bpy.path.abspath(self.filepath)) if self.filepath else None
        if report:
            files.check_output(report, others=_open_file(), overwrite=self.overwrite, replaces=files.REPORT)
        targets = selected_meshes(context, without=settings.source) or selected_meshes(context)
        checks = [check(obj, settings.source, params) for obj in targets]
        if report:
            files.write_report(
                report, [result.to_json() for result in checks], others=_open_file(), overwrite=self.overwrite
            )
        for result in checks:
            mesh.select(context.scene.objects[result.target], self._chosen(result))
            self.report({"WARNING" if any(result.counts().values()) else "INFO"}, result.sentence())
        return {"FINISHED"}

    def _chosen(self, result: WeightCheck):
        chosen = result.faulty.values() if self.select == "ALL" else [result.faulty[Fault[self.select]]]
        return np.logical_or.reduce(list(chosen))


def _open_file() -> list[Path]:
    """The .blend that is open, which no report replaces."""
    return [Path(bpy.data.filepath)] if bpy.data.filepath else []


register, unregister = registration(SKINWRIGHT_OT_check_weights)
