"""Store, restore, compare, export and import weights without a window, in Blender or in Python with the bpy wheel.

    blender -b file.blend -P blender_scripts/weights.py -- export --object Body --file body.npz
    python blender_scripts/weights.py import file.blend --object Body --file body.npz --save out.blend

docs/pages/stored.md describes the files. Exit codes: 0 done, 1 failed, 2 usage.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent))  # Blender leaves the script's folder out
    import headless

    headless.run("weights")
