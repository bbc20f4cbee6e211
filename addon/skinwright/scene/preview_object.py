"""A stand-in for a mesh whose positions somebody else computes: a hidden copy that is never saved."""

import json

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion
from numpy.typing import NDArray

MARK = "skinwright_preview_of"
_HIDDEN = "skinwright_hidden_by_preview"


def show(obj: bpy.types.Object) -> bpy.types.Object:
    """Put a copy without armature and keys in the place of `obj`, which is hidden in every view layer that shows it.

    Renders show the original alone: they are not made of what somebody else computes in the meantime.
    """
    copy = obj.copy()
    copy.data = obj.data.copy()
    copy.name = f"{obj.name} (Refined)"
    if copy.data.shape_keys:
        copy.shape_key_clear()
    last = max((i for i, m in enumerate(copy.modifiers) if m.type == "ARMATURE"), default=-1)
    for modifier in list(copy.modifiers)[: last + 1]:
        copy.modifiers.remove(modifier)
    copy.animation_data_clear()
    _follow(copy, obj)
    copy.hide_select = copy.hide_render = True
    copy[MARK] = obj.name
    own = [c for c in obj.users_collection if c.is_editable and not c.override_library]
    for collection in own or [bpy.context.scene.collection]:  # those of libraries take nothing in
        collection.objects.link(copy)
    for view in _local_views(obj):
        copy.local_view_set(view, True)
    _hide(obj)
    return copy


def _follow(copy: bpy.types.Object, obj: bpy.types.Object) -> None:
    """Let the copy be where the object is, however that is moved or parented."""
    copy.constraints.clear()
    copy.parent, copy.parent_type = obj, "OBJECT"
    copy.delta_location, copy.delta_scale = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    copy.delta_rotation_euler, copy.delta_rotation_quaternion = Euler(), Quaternion()
    copy.matrix_parent_inverse = copy.matrix_basis = Matrix.Identity(4)


def _hide(obj: bpy.types.Object) -> None:
    shown = [(scene, layer) for scene, layer in _layers(obj) if not obj.hide_get(view_layer=layer)]
    obj[_HIDDEN] = json.dumps([(scene.name, layer.name) for scene, layer in shown])
    for _, layer in shown:
        obj.hide_set(True, view_layer=layer)


def _show(obj: bpy.types.Object) -> None:
    hidden = [tuple(names) for names in json.loads(obj[_HIDDEN])]
    del obj[_HIDDEN]
    for scene, layer in _layers(obj):
        # A scene that has been renamed meanwhile shows the object rather than losing it.
        if (scene.name, layer.name) in hidden or not {(s, v) for s, v in hidden if s in bpy.data.scenes}:
            obj.hide_set(False, view_layer=layer)


def _layers(obj: bpy.types.Object) -> list[tuple[bpy.types.Scene, bpy.types.ViewLayer]]:
    """The view layers that have `obj`."""
    every = [(scene, layer) for scene in bpy.data.scenes for layer in scene.view_layers]
    return [(scene, layer) for scene, layer in every if obj.name in layer.objects]


def _local_views(obj: bpy.types.Object) -> list[bpy.types.SpaceView3D]:
    """The views that show only a choice of objects, `obj` among them; in Blender 4 its evaluated copy alone knows."""
    known = (obj, obj.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    areas = [area for window in bpy.context.window_manager.windows for area in window.screen.areas]
    views = [area.spaces.active for area in areas if area.type == "VIEW_3D"]
    return [view for view in views if view.local_view and any(one.local_view_get(view) for one in known)]


def place(name: str, positions: NDArray[np.float32]) -> bool:
    """Move the vertices of the copy of `name`; whether it is there and fits."""
    copy = of(name)
    if copy is None or len(copy.data.vertices) != len(positions):
        return False
    copy.data.vertices.foreach_set("co", np.ascontiguousarray(positions, np.float32).ravel())
    copy.data.update()
    return True


def of(name: str) -> bpy.types.Object | None:
    """The copy of the object of this name."""
    return next((obj for obj in bpy.data.objects if obj.get(MARK) == name), None)


def clear() -> int:
    """Remove every copy and show the originals again; how many there were."""
    copies = [obj for obj in bpy.data.objects if MARK in obj]
    for copy in copies:
        data = copy.data
        bpy.data.objects.remove(copy)
        if data.users == 0:
            bpy.data.meshes.remove(data)
    for obj in [obj for obj in bpy.data.objects if _HIDDEN in obj]:
        _show(obj)
    return len(copies)
