"""Bake refined skin without a window, in Blender or in Python with the bpy wheel.

    blender -b file.blend -P blender_scripts/refine.py -- correctives --object Body --bone forearm.L --save out.blend
    python blender_scripts/refine.py cache file.blend --object Body --cache body.pc2 --frames 1 120

The add-on is taken from Blender where it is enabled, else from this checkout. Exit codes: 0 done, 1 failed, 2 usage.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent))  # Blender leaves the script's folder out
    import headless

    headless.run("refine")
