import bpy

bpy.ops.skinwright.reset_settings()
