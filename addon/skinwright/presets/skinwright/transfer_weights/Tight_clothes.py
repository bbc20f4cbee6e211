from math import radians

import bpy

settings = bpy.context.scene.skinwright.transfer

settings.method = "CONFIDENCE"
settings.softness = 0.5
settings.distance_mode = "RELATIVE"
settings.relative_max_distance = 0.05
settings.max_normal_angle = radians(45)
settings.match_flipped_normals = True
settings.smoothness_mode = "RELATIVE"
settings.relative_smoothness_length = 0.05
settings.island_policy = "NEAREST"
settings.small_islands = "AUTO"
settings.smoothing_iterations = 0
settings.smoothing_factor = 0.2
