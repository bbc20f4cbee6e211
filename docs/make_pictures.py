"""Makes the manual's pictures in a real Blender window: `SKINWRIGHT_BLENDER_TREES=TREE python docs/make_pictures.py`.

Needs a Blender with a window (CONTRIBUTING) and the test characters (`SKINWRIGHT_DATA`); fills docs/pages/pictures.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
PAGES = ROOT / "docs" / "pages" / "pictures"
FILES = ("body.glb", "garments/helper_skirt.glb", "garments/F_Dress_03.glb")


def main() -> None:
    """Run the script in the first Blender that is named, and keep what it has photographed."""
    sys.path.insert(0, str(ROOT / "tests" / "gui"))
    import conftest

    blenders = conftest.found()
    if not blenders:
        raise SystemExit("No Blender with a window: set SKINWRIGHT_BLENDER_TREES or SKINWRIGHT_BLENDER (CONTRIBUTING).")
    files = tuple(DATA / "mh_female" / name for name in FILES)
    if not all(file.exists() for file in files):
        raise SystemExit(f"The test characters are missing: there is no {files[0]}; set SKINWRIGHT_DATA.")
    blender = blenders[0]
    blender.run("pictures", timeout=1500, size=(1280, 860), files=files)
    PAGES.mkdir(exist_ok=True)
    for picture in sorted((conftest.OUT / blender.name / "pictures").glob("*.png")):
        shutil.copy(picture, PAGES)
        print(picture.name)


if __name__ == "__main__":
    main()
