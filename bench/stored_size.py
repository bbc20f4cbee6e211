"""How much stored weights add to a .blend file: a file with none, one and six states, compressed by Blender and not.

    python bench/stored_size.py [FILE.glb ...]        (bodies of the data folder by default)

Sizes do not depend on the machine. The six states are of different weights; the shape is kept once for all.
"""

import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="skinwright-bench-"))

import bpy  # noqa: E402
import extension  # noqa: E402

DATA = Path(os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
BODIES = ("qm_men/Beach.glb", "q_female_peasant/body.glb")
STATES = 6


def saved(folder: str, compress: bool) -> int:
    """Bytes of the file as it would be saved now."""
    path = os.path.join(folder, "size.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True, compress=compress)
    return os.path.getsize(path)


def grown(obj: bpy.types.Object, number: int) -> None:
    """Other weights than before: every vertex of the first group a little less of it."""
    group = obj.vertex_groups[number % len(obj.vertex_groups)]
    members = [(v.index, m.weight) for v in obj.data.vertices for m in v.groups if m.group == group.index]
    for index, weight in members:
        group.add([index], weight * 0.9, "REPLACE")


def measure(path: Path, addon) -> str:
    """A row of the table."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    skinned = [obj for obj in bpy.data.objects if obj.type == "MESH" and obj.vertex_groups]
    obj = max(skinned, key=lambda one: len(one.data.vertices))
    members = sum(len(vertex.groups) for vertex in obj.data.vertices)
    keeping = addon.stored.keeping
    with tempfile.TemporaryDirectory() as folder:
        none = [saved(folder, compress) for compress in (True, False)]
        cells = []
        for number in range(STATES):
            keeping.keep(obj, f"State {number}")
            if number in (0, STATES - 1):
                now = [saved(folder, compress) for compress in (True, False)]
                cells.append(f"{keeping.size(obj) / 1024:,.0f}")
                cells.append(" / ".join(f"{(b - a) / 1024:+,.0f}" for a, b in zip(none, now, strict=True)))
            grown(obj, number)
    size = f"{none[0] / 1024:,.0f} / {none[1] / 1024:,.0f}"
    return (
        f"| {path.parent.name}/{path.stem} | {len(obj.data.vertices):,} | {members:,} | {size} | {' | '.join(cells)} |"
    )


def main(files: list[str]) -> None:
    addon = extension.enable()
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    rows = [measure(Path(file), addon) for file in files]
    print(
        "| file | vertices | members | .blend, KiB | one state, KiB | file grows by | six states, KiB | file grows by |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    print("\n".join(rows), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or [str(DATA / body) for body in BODIES])
    os._exit(0)
