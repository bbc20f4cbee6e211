from math import radians

import bpy

settings = bpy.context.scene.skinwright.transfer

settings.method = "CONFIDENCE"
settings.softness = 0.7
settings.distance_mode = "RELATIVE"
settings.relative_max_distance = 0.05
settings.max_normal_angle = radians(35)
settings.match_flipped_normals = True
settings.smoothness_mode = "RELATIVE"
settings.relative_smoothness_length = 0.05
settings.island_policy = "BRIDGE"
settings.small_islands = "AUTO"
settings.smoothing_iterations = 0
settings.smoothing_factor = 0.2
