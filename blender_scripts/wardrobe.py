"""Transfer many garments to many bodies without a window, in Blender or in Python with the bpy wheel.

    blender -b -P blender_scripts/wardrobe.py -- wardrobe.json --out results [--shard 2/8]
    python blender_scripts/wardrobe.py wardrobe.json --out results [--job male--coat]

A manifest is a JSON object: `bodies` and `garments`, lists of objects with `file` and optional `name`; a body may name
its `object`, a garment its `objects`, the `bodies` that it is for and its own `settings`; `settings` are those of a
transfer. A folder with bodies/ and garments/ does as well. What has a result from the same inputs is kept, so a run
that was ended goes on where it stopped. Exit codes: 0 done, 1 some failed, 2 usage.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent))  # Blender leaves the script's folder out
    import headless

    headless.run("wardrobe")
