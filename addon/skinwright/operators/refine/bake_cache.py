"""Bake Refined Cache: the scene's frames to a point cache that the Mesh Cache modifier plays."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty
from bpy.types import Context, Event

from ... import files, jobs, preferences
from ...refine import cache
from ...refine.params import FORMATS
from ...registration import registration
from ...scene import blend_file, mesh_cache
from ...scene.error import SceneError
from ...settings.refine import RefineSettings, adopt
from ..base import SkinwrightOperator
from ..modal.long_work import LongWork
from .targets import found, refusal


class SKINWRIGHT_OT_bake_refined_cache(LongWork, RefineSettings, SkinwrightOperator):
    """Solves frame by frame; the file is written whole at the end."""

    bl_idname = "skinwright.bake_refined_cache"
    bl_label = "Bake Refined Cache"
    bl_description = "Refine every frame of the range and play the result with a Mesh Cache modifier"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(
        name="File", description="Point cache to write; beside the .blend file if empty", subtype="FILE_PATH"
    )
    kind: EnumProperty(
        name="Format",
        description="Format of the file",
        items=[(name.upper(), *texts) for name, texts in FORMATS.items()],
    )
    frame_start: IntProperty(name="Start", description="First frame", default=1)
    frame_end: IntProperty(name="End", description="Last frame", default=250)
    overwrite: BoolProperty(
        name="Overwrite", description="Replace a file that is there already", default=False, options={"SKIP_SAVE"}
    )

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Mode and target."""
        return refusal(context, "bake a cache")

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """From the panel: with its settings and the scene's range."""
        adopt(self, context.scene.skinwright.refine, RefineSettings)
        for name in ("frame_start", "frame_end"):
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(context.scene, name))
        return self.attempt(lambda: self.begin(context, self._steps(context)))

    def work(self, context: Context) -> set[str]:
        """From a script: wait."""
        return self.complete(context, jobs.wait(self._steps(context)))

    def complete(self, _context: Context, report: cache.CacheReport) -> set[str]:
        """Say what was written."""
        return self.tell(report.sentence(), report.all_warnings())

    def _steps(self, context: Context) -> "jobs.Jobs[cache.CacheReport]":
        obj, kind = found(context), self.kind.lower()
        params = self.to_params(preferences.threads(context))
        path = self._path(obj.name, kind)
        mesh_cache.check_file(obj, path)
        files.check_output(path, others=blend_file.opened(), overwrite=self.overwrite or mesh_cache.is_own(obj, path))
        return cache.steps(obj, params, path, (self.frame_start, self.frame_end), kind)

    def _path(self, name: str, kind: str) -> Path:
        if self.filepath:
            return Path(bpy.path.abspath(self.filepath))
        if not bpy.data.filepath:
            raise SceneError("Save the file first, or name the cache's file: it is written beside the .blend file")
        return Path(bpy.path.abspath(f"//{bpy.path.clean_name(name)}_refined.{kind}"))


class SKINWRIGHT_OT_remove_refined_cache(SkinwrightOperator):
    """The modifier goes, the file stays."""

    bl_idname = "skinwright.remove_refined_cache"
    bl_label = "Remove Refined Cache"
    bl_description = "Remove the modifier that plays the refined cache; the file stays"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Only where there is one."""
        reason = refusal(context, "remove a cache")
        return reason or ("" if mesh_cache.NAME in found(context).modifiers else "This mesh plays no refined cache")

    def work(self, context: Context) -> set[str]:
        """Remove the modifier."""
        mesh_cache.remove(found(context))
        return {"FINISHED"}


register, unregister = registration(SKINWRIGHT_OT_bake_refined_cache, SKINWRIGHT_OT_remove_refined_cache)
