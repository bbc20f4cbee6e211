"""Embed an armature without a window, in Blender or in Python with the bpy wheel.

    blender -b file.blend -P blender_scripts/embed_armature.py -- --source ManRig --target Body \
        [--settings settings.json] [--report report.json] [--save out.blend]
    python blender_scripts/embed_armature.py file.blend --source ManRig --target Body --save out.blend

The add-on is taken from Blender where it is enabled, else from this checkout. Exit codes: 0 done, 1 failed, 2 usage.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent))  # Blender leaves the script's folder out
    import headless

    headless.run("embed_armature")
