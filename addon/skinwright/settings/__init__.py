"""The settings as Blender properties: one group per feature, kept in the scene and on objects."""

import bpy
from bpy.props import PointerProperty
from bpy.types import Object, PropertyGroup, Scene

from .embed import SKINWRIGHT_PG_embed
from .overlay import SKINWRIGHT_PG_overlay
from .refine import SKINWRIGHT_PG_refine
from .retarget import SKINWRIGHT_PG_bone_pair, SKINWRIGHT_PG_landmark, SKINWRIGHT_PG_retarget
from .sculpt import SKINWRIGHT_PG_sculpt
from .target import SKINWRIGHT_PG_object
from .transfer import SKINWRIGHT_PG_transfer, TransferSettings

__all__ = ["CLASSES", "TransferSettings", "register", "unregister"]


class SKINWRIGHT_PG_scene(PropertyGroup):
    """All of Skinwright's settings in a scene, one group a feature."""

    transfer: PointerProperty(type=SKINWRIGHT_PG_transfer)
    overlay: PointerProperty(type=SKINWRIGHT_PG_overlay)
    sculpt: PointerProperty(type=SKINWRIGHT_PG_sculpt)
    refine: PointerProperty(type=SKINWRIGHT_PG_refine)
    retarget: PointerProperty(type=SKINWRIGHT_PG_retarget)
    embed: PointerProperty(type=SKINWRIGHT_PG_embed)


CLASSES = (
    SKINWRIGHT_PG_transfer,
    SKINWRIGHT_PG_object,
    SKINWRIGHT_PG_overlay,
    SKINWRIGHT_PG_sculpt,
    SKINWRIGHT_PG_refine,
    SKINWRIGHT_PG_bone_pair,
    SKINWRIGHT_PG_landmark,
    SKINWRIGHT_PG_retarget,
    SKINWRIGHT_PG_embed,
    SKINWRIGHT_PG_scene,
)


def register() -> None:
    """Add the settings to scenes and objects."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    Scene.skinwright = PointerProperty(type=SKINWRIGHT_PG_scene)
    Object.skinwright = PointerProperty(type=SKINWRIGHT_PG_object)


def unregister() -> None:
    """Take them away again."""
    del Object.skinwright
    del Scene.skinwright
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
