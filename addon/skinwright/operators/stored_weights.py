"""Store, Restore, Compare, Forget, Export and Import Weights."""

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy.types import Context, Event, Object, Operator

from .. import files, preferences
from ..registration import registration
from ..scene import blend_file, editable, mesh
from ..stored import comparing, exchange, keeping, restoring
from .base import SkinwrightOperator, refusal_in_mode, selected_meshes

NEWEST = "-1"


class _OnMeshes(SkinwrightOperator):
    """Works on every selected mesh; `purpose` ends the sentence of its refusal."""

    bl_options = {"REGISTER", "UNDO"}
    purpose = "keep weights"

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Modes and targets."""
        found = refusal_in_mode(context, cls.purpose)
        return found or ("" if selected_meshes(context) else f"Select the meshes to {cls.purpose}")

    def work(self, context: Context) -> set[str]:
        """Outside of Edit mode, where weights can be neither read nor written."""
        with mesh.object_mode(context):
            return self.on_meshes(context, selected_meshes(context))

    def on_meshes(self, context: Context, objects: list[Object]) -> set[str]:
        """Do it."""
        raise NotImplementedError


class _OnActive(_OnMeshes):
    """Works on one state of the active mesh."""

    @classmethod
    def refusal(cls, context: Context) -> str:
        """The active mesh, and a state of it."""
        obj = context.active_object
        if obj is None or obj.type != "MESH":
            return f"Make a mesh the active object to {cls.purpose}"
        found = refusal_in_mode(context, cls.purpose)
        return found or ("" if keeping.entries(obj) else f"{obj.name} has no stored weights: store some first")

    def work(self, context: Context) -> set[str]:
        """On the active mesh."""
        with mesh.object_mode(context):
            return self.on_meshes(context, [context.active_object])


def _states(_self: Operator, context: Context | None) -> list[tuple[str, str, str]]:
    """The newest first; Blender needs the list to stay where it is."""
    obj = context.active_object if context else None
    found = keeping.entries(obj) if obj and obj.type == "MESH" else []
    items = [(NEWEST, "Newest", "The state that was stored last")]
    for number in range(len(found) - 1, -1, -1):
        entry = found[number]
        items.append((str(number), entry.name, f"{entry.vertices} vertices, {entry.members} members"))
    _kept_items[:] = items
    return _kept_items


_kept_items: list[tuple[str, str, str]] = []


def _state_property() -> Any:
    return EnumProperty(name="State", description="Which of the stored states", items=_states)


class SKINWRIGHT_OT_store_weights(_OnMeshes):
    """Keeps them in the file, on the mesh."""

    bl_idname = "skinwright.store_weights"
    bl_label = "Store Weights"
    bl_description = "Keep the weights of the selected meshes in the file under a name, to restore or compare later"

    state_name: StringProperty(name="Name", description="What the state is called", default="Weights", maxlen=63)

    def on_meshes(self, context: Context, objects: list[Object]) -> set[str]:
        """One state per mesh."""
        for obj in objects:
            editable.check(obj)
        for obj in objects:
            keeping.keep(obj, self.state_name or "Weights")
            self.report({"INFO"}, f"{obj.name}: weights stored; all states take {keeping.size(obj) / 1024:,.0f} KiB")
        return {"FINISHED"}


class SKINWRIGHT_OT_restore_weights(_OnActive):
    """By vertex order, or by position where the mesh has changed."""

    bl_idname = "skinwright.restore_weights"
    bl_label = "Restore Weights"
    bl_description = "Bring stored weights back to the active mesh; vertices that are new since then are inpainted"
    purpose = "restore weights"

    state: _state_property()

    def on_meshes(self, context: Context, objects: list[Object]) -> set[str]:
        """The present weights are kept first."""
        (obj,) = objects
        kept = keeping.load(obj, int(self.state or NEWEST))
        aligned = restoring.restore(obj, kept, preferences.threads(context), before_write=self.keep_before)
        self.report({"INFO"}, aligned.sentence(obj.name))
        return {"FINISHED"}


class SKINWRIGHT_OT_compare_weights(_OnActive):
    """A heat map over the mesh, and a sentence."""

    bl_idname = "skinwright.compare_weights"
    bl_label = "Compare Weights"
    bl_description = "Show where the weights of the active mesh differ from a stored state, and by how much"
    purpose = "compare weights"

    state: _state_property()

    def on_meshes(self, context: Context, objects: list[Object]) -> set[str]:
        """Nothing is written; the overlay shows the difference."""
        (obj,) = objects
        number = int(self.state or NEWEST)
        name = keeping.entries(obj)[number].name
        found = comparing.compare(obj, keeping.load(obj, number), name, preferences.threads(context))
        comparing.current = found
        context.scene.skinwright.overlay.kind = "DIFFERENCE"
        self.report({"INFO"}, found.sentence())
        return {"FINISHED"}


class SKINWRIGHT_OT_forget_weights(_OnMeshes):
    """Makes the file smaller."""

    bl_idname = "skinwright.forget_weights"
    bl_label = "Forget Stored Weights"
    bl_description = "Remove stored weights of the selected meshes from the file"
    purpose = "forget stored weights"

    which: EnumProperty(
        name="Which",
        description="Which states are removed",
        items=[
            ("AUTOMATIC", "Automatic", "Those that operations have stored by themselves"),
            ("ALL", "All", "Every state"),
        ],
    )

    def on_meshes(self, context: Context, objects: list[Object]) -> set[str]:
        """Say what it frees."""
        freed = sum(keeping.purge(obj, automatic_only=self.which == "AUTOMATIC") for obj in objects)
        self.report({"INFO"}, f"{freed / 1024:,.0f} KiB of stored weights removed")
        return {"FINISHED"}


class _File:
    """The file of an export or an import; a mix-in."""

    filepath: StringProperty(name="File", description="An .npz or a .json file", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.npz;*.json", options={"HIDDEN"}, name="Filter", description="Files shown")

    def invoke(self, context: Context, _event: Event) -> set[str]:
        """Ask for the file."""
        if not self.filepath:
            self.filepath = f"{bpy.path.clean_name(context.active_object.name)}.npz"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def path(self) -> Path:
        """As an absolute path."""
        if not self.filepath:
            raise files.FileError("There is no file name: give one that ends in .npz or .json")
        return Path(bpy.path.abspath(self.filepath))


class SKINWRIGHT_OT_export_weights(_File, _OnMeshes):
    """docs/pages/stored.md describes the files."""

    bl_idname = "skinwright.export_weights"
    bl_label = "Export Weights"
    bl_description = "Write the weights of the active mesh to a file that can be read without Blender"
    bl_options = {"REGISTER"}
    purpose = "export weights"

    overwrite: BoolProperty(name="Overwrite", description="Replace a file that is there already", default=False)

    def on_meshes(self, context: Context, objects: list[Object]) -> set[str]:
        """The active one."""
        obj = context.active_object if context.active_object in objects else objects[0]
        path = self.path()
        exchange.write(path, keeping.take(obj), overwrite=self.overwrite, others=blend_file.opened())
        self.report({"INFO"}, f"{obj.name}: weights written to {path.name}")
        return {"FINISHED"}


class SKINWRIGHT_OT_import_weights(_File, _OnMeshes):
    """By vertex order, or by position where the mesh differs."""

    bl_idname = "skinwright.import_weights"
    bl_label = "Import Weights"
    bl_description = "Give the active mesh the weights of a file that Export Weights has written"
    purpose = "import weights"

    def on_meshes(self, context: Context, objects: list[Object]) -> set[str]:
        """The present weights are kept first."""
        obj = context.active_object if context.active_object in objects else objects[0]
        kept = exchange.read(self.path())
        aligned = restoring.restore(obj, kept, preferences.threads(context), before_write=self.keep_before)
        self.report({"INFO"}, aligned.sentence(obj.name))
        return {"FINISHED"}


CLASSES = (
    SKINWRIGHT_OT_store_weights,
    SKINWRIGHT_OT_restore_weights,
    SKINWRIGHT_OT_compare_weights,
    SKINWRIGHT_OT_forget_weights,
    SKINWRIGHT_OT_export_weights,
    SKINWRIGHT_OT_import_weights,
)
register, unregister = registration(*CLASSES)
