import bpy

settings = bpy.context.scene.skinwright.transfer

settings.max_influences = 4
