"""Times the live weights while the match mask is painted, in a real window: milliseconds after the brush is released.

    SKINWRIGHT_BLENDER_TREES=TREE1:TREE2 python bench/mask_latency.py [VERTICES ...]     (20000 100000 by default)

Writes bench/mask_latency.md: both methods, 60 bones, median and worst of seven strokes.
"""

import os
import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "gui"))

from conftest import found
from machine import described

METHODS = ("PAPER", "CONFIDENCE")
COLUMNS = {
    "solve and write": "solve and write",
    "written": "**written**",
    "drawn": "drawn",
    "whole": "whole written",
    "overlay": "overlay made",
}
HEAD = """# From the release of the brush to the weights, painting the match mask

Made by `SKINWRIGHT_BLENDER_TREES=TREE1:TREE2 python bench/mask_latency.py`. A dress on a figure of 60 bones;
a brush that inpaints, held still before it is let go. Milliseconds, median (worst) of 7 strokes, each after the one
before has been solved as a whole. {machine}

"first solve" is the one that the session begins with. "written" counts from the release and contains "solve and write",
which begins once the timer has noticed the stroke. A stroke with the method *confidence* on a large garment is answered
twice: the rows around it are written first, and those of the solve of the whole after the brush has rested for 0.3 s.
The processor draws, as this machine has no graphics card: "drawn" says little of one that has.
"""


def main(sizes: list[str]) -> None:
    blenders = found()
    if not blenders:
        sys.exit("no Blender with a window: set SKINWRIGHT_BLENDER_TREES or SKINWRIGHT_BLENDER")
    text = HEAD.format(machine=described(os.getloadavg()[0]))
    for blender in blenders:
        record = blender.run("latency", ",".join(METHODS), *sizes, timeout=600, size=(800, 600))
        text += table(record)
    print(text)
    Path(__file__).with_suffix(".md").write_text(text, encoding="utf-8")


def table(record: dict) -> str:
    """The figures of one Blender."""
    lines = [
        f"\n## Blender {record.pop('version')}\n",
        f"| vertices | method | first solve | {' | '.join(COLUMNS.values())} |",
        "| ---: | :--- | ---: |" + " ---: |" * len(COLUMNS),
    ]
    for case, figures in record.items():
        vertices, method = case.split()
        cells = [f"{int(vertices):,}", method, f"{figures['first solve'] * 1e3:.0f}"]
        for name in COLUMNS:
            cells.append(f"{statistics.median(figures[name]) * 1e3:.0f} ({max(figures[name]) * 1e3:.0f})")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main(sys.argv[1:] or ["20000", "100000"])
