"""The weight that Blender's Weight Paint brush lays down, whether the brush has its own or shares the unified one."""

import bpy

from .error import SceneError


def weight(context: bpy.types.Context) -> float | None:
    """The weight in force, None without a brush."""
    holder = _holder(context)
    return holder.weight if holder else None


def set_weight(context: bpy.types.Context, value: float) -> None:
    """Change the weight in force. Raises SceneError without a brush."""
    holder = _holder(context)
    if holder is None:
        raise SceneError("Weight Paint mode has no active brush: pick one in the tool settings")
    holder.weight = value


def _holder(context: bpy.types.Context) -> bpy.types.Brush | bpy.types.UnifiedPaintSettings | None:
    """What the brush takes its weight from. The unified settings moved into the mode's own in Blender 5.0."""
    settings = context.tool_settings
    paint = settings.weight_paint
    if paint is None or paint.brush is None:
        return None
    unified = getattr(paint, "unified_paint_settings", None) or settings.unified_paint_settings
    return unified if unified.use_unified_weight else paint.brush
