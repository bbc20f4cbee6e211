"""Retarget Weights in the Weights tab: source, bone map, settings, button."""

from typing import Any

from bpy.types import Context, Panel, UILayout, UIList

from .. import jobs
from ..registration import registration
from .panel import Tab

# Partners less sure than this are marked.
UNSURE = 0.5


class SKINWRIGHT_UL_bone_map(UIList):
    """The bones of the target; those without a sure partner are marked."""

    def draw_item(
        self,
        context: Context,
        layout: UILayout,
        _settings: Any,
        entry: Any,
        _icon: int,
        _active: Any,
        *_more: Any,
    ) -> None:
        """Bone, partner, confidence. Blender counts the named arguments: at least seven."""
        sure = entry.source and (entry.source != entry.found or entry.confidence >= UNSURE)
        row = layout.row(align=True)
        row.label(text=entry.name, icon="BONE_DATA" if sure else "ERROR")
        source = context.scene.skinwright.retarget.source
        if source:
            row.prop_search(entry, "source", source.data, "bones", text="")
        edited = entry.source != entry.found
        row.label(text="edited" if edited else f"{entry.confidence:.0%}" if entry.source else entry.how)


class SKINWRIGHT_PT_retarget(Tab, Panel):
    """Source and button; all else has a default that does."""

    bl_label = "Retarget Weights"
    bl_order = 6
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """As the transfer's panel."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(context.scene.skinwright.retarget, "source")
        if jobs.running:
            layout.progress(factor=jobs.running.progress, text=f"{jobs.running.progress:.0%}, Esc stops")
        layout.operator("skinwright.retarget_weights", icon="MOD_ARMATURE")


class SKINWRIGHT_PT_retarget_bones(Tab, Panel):
    """Which bone is which."""

    bl_label = "Bone Map"
    bl_parent_id = "SKINWRIGHT_PT_retarget"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """The list, and what fills and keeps it."""
        settings = context.scene.skinwright.retarget
        self.layout.operator("skinwright.match_bones", icon="FILE_REFRESH")
        if settings.bone_map:
            self.layout.label(text=settings.bone_map_of)
            self.layout.template_list(
                "SKINWRIGHT_UL_bone_map", "", settings, "bone_map", settings, "bone_map_index", rows=6
            )
        row = self.layout.row(align=True)
        row.operator("skinwright.bone_map_load", text="Load", icon="IMPORT")
        row.operator("skinwright.bone_map_save", text="Save", icon="EXPORT")


class SKINWRIGHT_UL_landmarks(UIList):
    """Landmarks with both of their places; those that lack one are marked."""

    def draw_item(
        self,
        _context: Context,
        layout: UILayout,
        _settings: Any,
        entry: Any,
        _icon: int,
        _active: Any,
        *_more: Any,
    ) -> None:
        """Name and two places. Blender counts the named arguments: at least seven."""
        row = layout.row(align=True)
        row.prop(entry, "name", text="", emboss=False, icon="DOT" if entry.source and entry.target else "ERROR")
        for side in ("source", "target"):
            obj = getattr(entry, side)
            vertex = f" {getattr(entry, f'{side}_vertex')}" if obj and obj.type == "MESH" else ""
            row.label(text=f"{obj.name}{vertex}" if obj else f"no {side}")


class SKINWRIGHT_PT_retarget_landmarks(Tab, Panel):
    """Places that the artist says are the same, for the Biharmonic method."""

    bl_label = "Landmarks"
    bl_parent_id = "SKINWRIGHT_PT_retarget"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """The other method does not use them."""
        return context.scene.skinwright.retarget.method == "BIHARMONIC"

    def draw(self, context: Context) -> None:
        """List, the active one's places, and what fills it."""
        layout, settings = self.layout, context.scene.skinwright.retarget
        layout.use_property_split = True
        layout.use_property_decorate = False
        row = layout.row(align=True)
        row.operator("skinwright.landmark_pick", icon="VERTEXSEL")
        row.operator("skinwright.landmark_add", icon="EMPTY_AXIS")
        if not settings.landmarks:
            return
        row = layout.row()
        row.template_list("SKINWRIGHT_UL_landmarks", "", settings, "landmarks", settings, "landmarks_index", rows=4)
        column = row.column(align=True)
        column.operator("skinwright.landmark_remove", text="", icon="REMOVE").which = "ACTIVE"
        column.operator("skinwright.landmark_remove", text="", icon="TRASH").which = "ALL"
        entry = settings.landmarks[min(settings.landmarks_index, len(settings.landmarks) - 1)]
        for side in ("source", "target"):
            layout.prop(entry, side)
            obj = getattr(entry, side)
            if obj and obj.type == "MESH":
                layout.prop(entry, f"{side}_vertex")


class SKINWRIGHT_PT_embed(Tab, Panel):
    """An armature for a mesh that has none."""

    bl_label = "Embed Armature"
    bl_parent_id = "SKINWRIGHT_PT_retarget"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """The source is that of retargeting."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        context.scene.skinwright.embed.draw_settings(self.layout)
        self.layout.operator("skinwright.embed_armature", icon="OUTLINER_OB_ARMATURE")


class SKINWRIGHT_PT_retarget_settings(Tab, Panel):
    """How vertices are matched and rows written."""

    bl_label = "Matching and Writing"
    bl_parent_id = "SKINWRIGHT_PT_retarget"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """As the operator lays them out."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        context.scene.skinwright.retarget.draw_settings(self.layout)


register, unregister = registration(
    SKINWRIGHT_UL_bone_map,
    SKINWRIGHT_UL_landmarks,
    SKINWRIGHT_PT_retarget,
    SKINWRIGHT_PT_retarget_bones,
    SKINWRIGHT_PT_retarget_landmarks,
    SKINWRIGHT_PT_retarget_settings,
    SKINWRIGHT_PT_embed,
)
