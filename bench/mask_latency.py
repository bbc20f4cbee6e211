"""Times the live weights while the match mask is painted, in a real window: milliseconds after the brush is released.

    SKINWRIGHT_BLENDER_TREES=TREE1:TREE2 python bench/mask_latency.py [VERTICES ...]     (20000 100000 by default)

60 bones, 40 % of the garment inpainted; median and worst of seven strokes. Software rendering: the last column is
mostly the drawing of the view, which a graphics card does in a few milliseconds.
"""

import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "gui"))

from conftest import found


def main(sizes: list[str]) -> None:
    blenders = found()
    if not blenders:
        sys.exit("no Blender with a window: set SKINWRIGHT_BLENDER_TREES or SKINWRIGHT_BLENDER")
    for blender in blenders:
        record = blender.run("latency", *sizes, timeout=400, size=(800, 600))
        print(f"\nBlender {record.pop('version')}\n")
        print(
            "| vertices | first solve | solve and write | written after release | drawn after release | overlay made |"
        )
        print("|---|---|---|---|---|---|")
        for vertices, figures in record.items():
            cells = [f"{figures['first solve'] * 1e3:.0f}"]
            for name in ("solve and write", "written", "drawn", "overlay"):
                cells.append(f"{statistics.median(figures[name]) * 1e3:.0f} (worst {max(figures[name]) * 1e3:.0f})")
            print(f"| {vertices} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main(sys.argv[1:] or ["20000", "100000"])
