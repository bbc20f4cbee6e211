"""Times what follows the release of a sculpt stroke, in a real window, part by part; writes bench/sculpt_latency.md.

    SKINWRIGHT_BLENDER_TREES=TREE1:TREE2 python bench/sculpt_latency.py [VERTICES ...]

20000, 100000 and 300000 vertices by default. The mouse is the X server's, so that Blender wakes up as it does for an
artist. What the parts are stands in the file.
"""

import os
import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "gui"))

from conftest import Blender, found
from machine import described

PARTS = ("noticed", "look", "solve", "write", "put back", "ours", "evaluate", "updated", "made ready", "drawn")
HEAD = """# From mouse-up to the updated view, sculpting weights

Made by `SKINWRIGHT_BLENDER_TREES=TREE1:TREE2 python bench/sculpt_latency.py`. A character of 60 bones, 4 members a
vertex; a Grab brush that touches about 2,000 vertices and is held still before it is let go, at a random moment.
Milliseconds, median (worst) of {strokes} strokes. {machine}

| part | whose | what |
| --- | --- | --- |
| noticed | Blender | its loop wakes up, ends the brush with its undo step, and hands on our timer's event |
| look | ours | which vertices have moved |
| solve | ours | the pose's matrices, the weights, and all else of the session |
| write | ours | the weights; the mesh got an array of its own for them while the brush was held still |
| put back | ours | the positions at rest |
| ours | ours | the last four: the whole of `SculptSession.stroke` |
| evaluate | Blender | the Armature modifier, and Sculpt mode's search tree and deformation matrices |
| **updated** | | from mouse-up to the evaluated mesh |
| made ready | Blender | buffers for drawing, and other editors |
| drawn | | from mouse-up to the view drawn |

The processor draws, as this machine has no graphics card: "drawn" says little of one that has. "noticed" is longer
too, for while a brush is down Blender puts the window together anew at each event of a timer (about 12 ms here), and
a release in that time waits. The last column counts the strokes whose weights were written before Blender evaluated or
drew anything after the release.
"""


def main(sizes: list[str]) -> None:
    blenders = found()
    if not blenders:
        sys.exit("no Blender with a window: set SKINWRIGHT_BLENDER_TREES or SKINWRIGHT_BLENDER")
    load = os.getloadavg()[0]
    tables, strokes = zip(*[table(blender, sizes) for blender in blenders], strict=True)
    text = HEAD.format(strokes=strokes[0], machine=described(load)) + "".join(tables)
    Path(__file__).with_suffix(".md").write_text(text)
    print(text)


def table(blender: Blender, sizes: list[str]) -> tuple[str, int]:
    """One Blender's rows, and the number of strokes."""
    rows = ""
    for size in sizes:
        record = blender.run("sculpt_latency", size, timeout=300, size=(800, 600), real_mouse=True)
        strokes = record["strokes"]
        early = sum(not stroke["came before"] for stroke in strokes)
        touched = statistics.median(stroke["touched"] for stroke in strokes)
        figures = [figure(strokes, part) for part in PARTS]
        rows += f"| {record['vertices']:,} | {touched:.0f} | {' | '.join(figures)} | {early} of {len(strokes)} |\n"
    head = f"| vertices | touched | {' | '.join(PARTS)} | weights first |\n"
    return f"\n## Blender {record['version']}\n\n{head}{'| ---: ' * (len(PARTS) + 3)}|\n{rows}", len(strokes)


def figure(strokes: list[dict[str, float]], part: str) -> str:
    """Median and worst."""
    times = [stroke[part] * 1e3 for stroke in strokes]
    return f"{statistics.median(times):.1f} ({max(times):.0f})"


if __name__ == "__main__":
    main(sys.argv[1:] or ["20000", "100000", "300000"])
