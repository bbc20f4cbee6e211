#!/bin/bash
# Compares the bits of the Linux wheel for ARM, run under qemu, with those of this machine's module:
#
#   blender_scripts/test_arm64.sh PYTHON    # PYTHON has this machine's module
#
# Needs qemu-user-static and mmdebstrap (apt-get install), a wheel in dist/wheels, no root. Skips with a sentence where
# one of them is missing. There is no Blender for Linux on ARM, so the add-on's layer is not tested there.
set -euo pipefail
cd "$(dirname "$0")/.."
python="${1:?usage: $0 PYTHON}"
tree=out/arm64

skip() { echo "Linux on ARM is not tested: $1"; exit 0; }
command -v qemu-aarch64-static >/dev/null || skip "qemu is missing (apt-get install qemu-user-static)."
command -v mmdebstrap >/dev/null || skip "mmdebstrap is missing (apt-get install mmdebstrap)."
wheel=$(ls -t dist/wheels/*manylinux_2_28_aarch64.whl 2>/dev/null | head -1)
[ -n "$wheel" ] || skip "there is no wheel for it (make wheels PLATFORMS=linux-arm64)."

if [ ! -e "$tree/complete" ]; then
    rm -rf "$tree" && mkdir -p "$tree"
    mirror=$(grep -h ^URIs /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1 | awk '{print $2}' || true)
    mmdebstrap --variant=extract --arch=arm64 --include=python3,libstdc++6,libgomp1 trixie "$tree" \
        "${mirror:-http://deb.debian.org/debian}"
    for folder in bin lib sbin; do
        [ -e "$tree/$folder" ] || ln -s "usr/$folder" "$tree/$folder"
    done
    "$python" -m pip download --quiet --only-binary :all: --platform manylinux_2_28_aarch64 --platform \
        manylinux2014_aarch64 --python-version 3.13 --no-deps --dest "$tree/wheels" numpy==2.2.6
    "$python" -m zipfile -e "$tree"/wheels/numpy*.whl "$tree/site"
    touch "$tree/complete"
fi
"$python" -m zipfile -e "$wheel" "$tree/site"
"$python" blender_scripts/bits.py > out/bits-here.txt
PYTHONPATH="$tree/site" qemu-aarch64-static -L "$tree" "$tree/usr/bin/python3.13" blender_scripts/bits.py > out/bits-arm64.txt
diff out/bits-here.txt out/bits-arm64.txt
# The same processor without its wide instructions, which fuse products and sums: faer's small blocks then round otherwise.
if command -v qemu-x86_64-static >/dev/null; then
    qemu-x86_64-static -cpu qemu64 "$python" blender_scripts/bits.py > out/bits-scalar.txt
    differing=$(diff out/bits-here.txt out/bits-scalar.txt | grep -c '^<' || true)
    echo "$(($(wc -l < out/bits-scalar.txt) - differing)) of $(wc -l < out/bits-scalar.txt) results have the same bits without AVX2 and FMA."
fi
echo "$(wc -l < out/bits-arm64.txt) results have the same bits on x86-64 and on ARM."
