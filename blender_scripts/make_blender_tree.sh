#!/bin/bash
# Makes a folder that holds a whole Debian with Blender, a virtual screen and a screenshot tool, for the GUI tests:
#
#   sudo blender_scripts/make_blender_tree.sh 4.3 TREE    # Debian 13 (trixie): Blender 4.3.2, stable
#   sudo blender_scripts/make_blender_tree.sh 5.2 TREE    # Debian unstable (sid): Blender 5.2 LTS, moves
#   SKINWRIGHT_BLENDER_TREES=TREE1:TREE2 python -m pytest tests/gui
#
# Needs root and mmdebstrap (apt-get install mmdebstrap); about one minute and 1.5 GB a tree. Nothing is mounted.
set -euo pipefail
case "${1:-}" in
    4.3) suite=trixie ;;
    5.2) suite=sid ;;
    *) echo "usage: $0 4.3|5.2 TREE" >&2; exit 2 ;;
esac
tree="${2:?usage: $0 4.3|5.2 TREE}"
mirror=$(grep -h ^URIs /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1 | awk '{print $2}' || true)

# Blender's Debian package brings neither numpy nor what its extension platform imports (requests, zstandard, cattrs).
# A mirror's copy of sid may be older than its Release file allows.
packages=blender,python3-numpy,python3-requests,python3-zstandard,xvfb,xauth,imagemagick,libgl1-mesa-dri,libegl1,libgl1
mmdebstrap --variant=apt --mode=root --aptopt='Acquire::Check-Valid-Until "false"' --include="$packages" \
    "$suite" "$tree" "${mirror:-http://deb.debian.org/debian}"
chroot "$tree" blender -b --factory-startup --python-expr 'import bpy, sys; print("made", bpy.app.version_string, sys.version.split()[0])'
