"""Landmarks of the Biharmonic method: vertices that the artist picks, or empties moved onto the surfaces."""

from bpy.props import EnumProperty
from bpy.types import Context, Object

from ..errors import Refused
from ..registration import registration
from ..scene import armature, landmarks, mesh
from ..settings.retarget import SKINWRIGHT_PG_landmark, SKINWRIGHT_PG_retarget
from .base import SkinwrightOperator, refusal_in_mode

# Size of the empties, as a share of the character's diagonal.
SIZE = 0.01


class SKINWRIGHT_OT_landmark_pick(SkinwrightOperator):
    """The side is that of the mesh: the source's if the source's armature deforms it."""

    bl_idname = "skinwright.landmark_pick"
    bl_label = "Pick Vertex"
    bl_description = "Use the selected vertex of the active mesh as one side of a landmark; do so on both characters"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """A source, and a mesh of either character."""
        found = refusal_in_mode(context, "pick a landmark") or _without_source(context)
        if found:
            return found
        obj = context.active_object
        return "" if obj and obj.type == "MESH" else "Make a mesh of one of the characters the active object"

    def work(self, context: Context) -> set[str]:
        """Complete the active landmark, or add one."""
        settings, obj = context.scene.skinwright.retarget, context.active_object
        vertex = mesh.active_vertex(obj)
        if vertex is None:
            raise Refused(f"{obj.name} has no selected vertex: select the one that is the landmark in Edit mode")
        side = _side_of(settings, obj)
        entry = _incomplete(settings, side) or _added(settings)
        entry.put(side, obj, vertex)
        self.report({"INFO"}, f"{entry.name}: vertex {vertex} of {obj.name} is its place on the {side}")
        return {"FINISHED"}


class SKINWRIGHT_OT_landmark_add(SkinwrightOperator):
    """Two empties at the middles of the characters, selected, for the artist to move."""

    bl_idname = "skinwright.landmark_add"
    bl_label = "Add Empties"
    bl_description = "Add an empty for each character; move both onto the same place of the bodies"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def refusal(cls, context: Context) -> str:
        """A source, and a mesh of the target."""
        if context.mode != "OBJECT":
            return "Go to Object mode to add empties"
        found = _without_source(context)
        return found if found or _target_mesh(context) else "Select a mesh of the character that shall get weights"

    def work(self, context: Context) -> set[str]:
        """Add them."""
        settings = context.scene.skinwright.retarget
        bodies = {"source": settings.source, "target": _target_mesh(context)}
        entry = _added(settings)
        for side, body in bodies.items():
            place, size = landmarks.middle_and_size(body)
            empty = landmarks.add_empty(context, f"{entry.name} {side.title()}", place, SIZE * size)
            entry.put(side, empty, 0)
        return {"FINISHED"}


class SKINWRIGHT_OT_landmark_remove(SkinwrightOperator):
    """Empties that the user made are left alone."""

    bl_idname = "skinwright.landmark_remove"
    bl_label = "Remove Landmarks"
    bl_description = "Remove landmarks, and the empties that were added for them"
    bl_options = {"REGISTER", "UNDO"}

    which: EnumProperty(
        name="Which",
        description="Which landmarks are removed",
        items=[("ACTIVE", "Active", "The active one"), ("ALL", "All", "Every landmark")],
    )

    @classmethod
    def refusal(cls, context: Context) -> str:
        """There must be one."""
        return "" if context.scene.skinwright.retarget.landmarks else "There is no landmark to remove"

    def work(self, context: Context) -> set[str]:
        """Take the entries out of the list."""
        settings = context.scene.skinwright.retarget
        last = len(settings.landmarks) - 1
        indices = [min(settings.landmarks_index, last)] if self.which == "ACTIVE" else range(last, -1, -1)
        for index in indices:
            entry = settings.landmarks[index]
            for obj in (entry.source, entry.target):
                landmarks.remove_empty(obj)
            settings.landmarks.remove(index)
        settings.landmarks_index = max(0, min(settings.landmarks_index, len(settings.landmarks) - 1))
        return {"FINISHED"}


def _without_source(context: Context) -> str:
    if context.scene.skinwright.retarget.source is None:
        return "Pick the armature of the character to take weights from as Source"
    return ""


def _side_of(settings: SKINWRIGHT_PG_retarget, obj: Object) -> str:
    return "source" if armature.find(obj) == settings.source else "target"


def _target_mesh(context: Context) -> Object | None:
    settings = context.scene.skinwright.retarget
    meshes = (obj for obj in context.selected_objects if obj.type == "MESH")
    return next((obj for obj in meshes if _side_of(settings, obj) == "target"), None)


def _incomplete(settings: SKINWRIGHT_PG_retarget, side: str) -> SKINWRIGHT_PG_landmark | None:
    """The first landmark that has the other side only."""
    return next((entry for entry in settings.landmarks if getattr(entry, side) is None), None)


def _added(settings: SKINWRIGHT_PG_retarget) -> SKINWRIGHT_PG_landmark:
    taken = {entry.name for entry in settings.landmarks}
    entry = settings.landmarks.add()
    entry.name = next(name for k in range(1, len(taken) + 2) if (name := f"Landmark {k}") not in taken)
    settings.landmarks_index = len(settings.landmarks) - 1
    return entry


register, unregister = registration(
    SKINWRIGHT_OT_landmark_pick, SKINWRIGHT_OT_landmark_add, SKINWRIGHT_OT_landmark_remove
)
