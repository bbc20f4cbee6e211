"""Times what follows the release of a sculpt stroke, in a real window, part by part, in milliseconds.

    SKINWRIGHT_BLENDER_TREES=TREE1:TREE2 python bench/sculpt_latency.py [VERTICES ...]     (20000 100000 by default)

60 bones, 4 members a vertex; median and worst of nine strokes. "noticed" is the wait for the next look, "taken" is all
of the session's work (look for what has moved, solve, write weights, put positions back), "evaluate" is Blender's
Armature modifier, "updated" and "drawn" are since the release. Software rendering: what "drawn" has beyond "updated" a
graphics card does in a few milliseconds.
"""

import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "gui"))

from conftest import found

PARTS = ("noticed", "look", "solve", "write", "taken", "evaluate", "updated", "drawn")


def main(sizes: list[str]) -> None:
    blenders = found()
    if not blenders:
        sys.exit("no Blender with a window: set SKINWRIGHT_BLENDER_TREES or SKINWRIGHT_BLENDER")
    for blender in blenders:
        record = blender.run("sculpt_latency", *sizes, timeout=400, size=(800, 600))
        print(f"\nBlender {record.pop('version')}\n")
        print(f"| vertices | touched | {' | '.join(PARTS)} |")
        print("|---" * (len(PARTS) + 2) + "|")
        for vertices, figures in record.items():
            cells = [f"{statistics.median(figures['vertices']):.0f}"]
            for name in PARTS:
                cells.append(f"{statistics.median(figures[name]) * 1e3:.1f} (worst {max(figures[name]) * 1e3:.0f})")
            print(f"| {vertices} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main(sys.argv[1:] or ["20000", "100000"])
