"""Entries in Blender's own menus."""

from bpy.types import (
    Context,
    Menu,
    VIEW3D_MT_make_links,
    VIEW3D_MT_object_parent,
    VIEW3D_MT_paint_weight,
    VIEW3D_MT_sculpt,
)


def _transfer_weights(menu: Menu, _context: Context) -> None:
    menu.layout.separator()
    menu.layout.operator("skinwright.transfer_weights", text="Transfer Weights (Skinwright)")


def _link_weights(menu: Menu, context: Context) -> None:
    _transfer_weights(menu, context)
    menu.layout.operator("skinwright.retarget_weights", text="Retarget Weights (Skinwright)")


def _automatic_weights(menu: Menu, _context: Context) -> None:
    menu.layout.separator()
    menu.layout.operator("skinwright.automatic_weights", text="Automatic Weights (Skinwright)")


def _paint_weight(menu: Menu, context: Context) -> None:
    _transfer_weights(menu, context)
    menu.layout.operator("skinwright.desparsify", text="Add Bone Slots (Skinwright)")


def _sculpt_weights(menu: Menu, _context: Context) -> None:
    menu.layout.separator()
    menu.layout.operator("skinwright.sculpt_weights", text="Sculpt Weights (Skinwright)")


ENTRIES = (
    (VIEW3D_MT_object_parent, _automatic_weights),
    (VIEW3D_MT_paint_weight, _paint_weight),
    (VIEW3D_MT_make_links, _link_weights),
    (VIEW3D_MT_sculpt, _sculpt_weights),
)


def register() -> None:
    """Append the entries."""
    for menu, draw in ENTRIES:
        menu.append(draw)


def unregister() -> None:
    """Remove them."""
    for menu, draw in ENTRIES:
        menu.remove(draw)
