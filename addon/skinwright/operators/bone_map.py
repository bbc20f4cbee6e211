"""Match Bones, and bone maps kept as files: the list that says which bone of one character is which of another."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import StringProperty
from bpy.types import Context, Event, Object
from bpy_extras.io_utils import ExportHelper, ImportHelper

from .. import files
from ..errors import Refused
from ..registration import registration
from ..retarget import RetargetParams, match_bones, rest_bones_of
from ..scene import armature, blend_file
from ..settings.retarget import SKINWRIGHT_PG_retarget, pair_key
from .base import SkinwrightOperator
from .retarget_weights import refusal, targets


class SKINWRIGHT_OT_match_bones(SkinwrightOperator):
    """Fills the list; what the artist changed in it is replaced."""

    bl_idname = "skinwright.match_bones"
    bl_label = "Match Bones"
    bl_description = "Pair the bones of both characters by name, by the names of common rigs, and by their place"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """As for retargeting."""
        return refusal(context)

    def work(self, context: Context) -> set[str]:
        """Find the partners and show them."""
        settings, rig = context.scene.skinwright.retarget, target_armature(context)
        fill(settings, rig, {})
        alone = sum(not entry.source for entry in settings.bone_map)
        self.report({"INFO"}, f"{len(settings.bone_map) - alone} of {len(settings.bone_map)} bones have a partner")
        return {"FINISHED"}


class SKINWRIGHT_OT_bone_map_save(ExportHelper, SkinwrightOperator):
    """The list as a JSON file."""

    bl_idname = "skinwright.bone_map_save"
    bl_label = "Save Bone Map"
    bl_description = "Save the bone map as a JSON file, to be used for other characters with the same rigs"
    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"}, name="Filter", description="Files shown")
    if TYPE_CHECKING:
        filepath: str  # the base's property

    @classmethod
    def refusal(cls, context: Context) -> str:
        """There must be one."""
        return "" if context.scene.skinwright.retarget.bone_map else "Match the bones first"

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for a file, beside the presets unless another folder was used."""
        if not self.filepath:
            self.filepath = str(preset_folder() / "bone_map.json")
        return super().invoke(context, event)

    def work(self, context: Context) -> set[str]:
        """Names only: it may be read for other characters."""
        entries = {entry.name: entry.source for entry in context.scene.skinwright.retarget.bone_map}
        text = json.dumps({"bone_map": entries}, indent=2, ensure_ascii=False)
        path = Path(bpy.path.abspath(self.filepath))
        files.check_output(path, others=blend_file.opened(), overwrite=_is_bone_map(path))
        files.write_whole(path, (text + "\n").encode())
        return {"FINISHED"}


class SKINWRIGHT_OT_bone_map_load(ImportHelper, SkinwrightOperator):
    """A list from a JSON file; bones that it does not know are matched automatically."""

    bl_idname = "skinwright.bone_map_load"
    bl_label = "Load Bone Map"
    bl_description = "Load a bone map from a JSON file; bones it does not name are matched automatically"
    bl_options = {"REGISTER", "UNDO"}
    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"}, name="Filter", description="Files shown")
    if TYPE_CHECKING:
        filepath: str  # the base's property

    @classmethod
    def refusal(cls, context: Context) -> str:
        """As for retargeting."""
        return refusal(context)

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for a file, in the folder of the presets first."""
        if not self.filepath:
            self.filepath = str(preset_folder()) + "/"
        return super().invoke(context, event)

    def work(self, context: Context) -> set[str]:
        """Names of bones that these characters lack are left out."""
        given = read_map(Path(bpy.path.abspath(self.filepath)))
        settings, rig = context.scene.skinwright.retarget, target_armature(context)
        source, target = rest_bones_of(settings.source).names, rest_bones_of(rig).names
        known = {bone: other for bone, other in given.items() if bone in target and (not other or other in source)}
        fill(settings, rig, known)
        self.report({"INFO"}, f"{len(known)} of {len(given)} entries concern bones of these characters")
        return {"FINISHED"}


def target_armature(context: Context) -> Object:
    """That of the selected meshes."""
    rig = armature.find(targets(context)[0])
    if rig is None:
        raise Refused(f"{targets(context)[0].name} has no armature: give it an Armature modifier")
    return rig


def fill(settings: SKINWRIGHT_PG_retarget, rig: Object, given: dict[str, str]) -> None:
    """Write the partners of the bones of armature `rig` into the list."""
    params = RetargetParams(bone_map=given)
    matches = match_bones(rest_bones_of(settings.source), rest_bones_of(rig), params)
    settings.bone_map.clear()
    settings.bone_map_index = 0
    settings.bone_map_of = pair_key(settings.source, rig)
    for match in matches:
        entry = settings.bone_map.add()
        entry.name, entry.source, entry.found = match.target, match.source, match.source
        entry.how, entry.confidence = match.how, match.confidence


def read_map(path: Path) -> dict[str, str]:
    """The names of a file. Raises Refused if it holds no bone map."""
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise Refused(f"{path.name} cannot be read as a bone map: {error}") from error
    entries = content.get("bone_map") if isinstance(content, dict) else None
    if not isinstance(entries, dict) or not all(isinstance(name, str) for name in entries.values()):
        raise Refused(f"{path.name} holds no bone map: it must be an object with an object bone_map of names")
    return entries


def _is_bone_map(path: Path) -> bool:
    """Whether saving over this file loses nothing but another bone map."""
    try:
        read_map(path)
    except Refused:
        return False
    return True


def preset_folder() -> Path:
    """Where the user's bone maps are kept."""
    return Path(bpy.utils.user_resource("SCRIPTS", path="presets/skinwright/bone_map", create=True))


register, unregister = registration(SKINWRIGHT_OT_match_bones, SKINWRIGHT_OT_bone_map_save, SKINWRIGHT_OT_bone_map_load)
