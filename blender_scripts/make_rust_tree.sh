#!/bin/bash
# Makes a folder that holds a Debian with Rust, the source of its standard library, and linkers for every platform that
# Blender runs on, for machines where rustup cannot fetch the other targets' standard libraries:
#
#   sudo blender_scripts/make_rust_tree.sh TREE
#   SKINWRIGHT_RUST_TREE=TREE make wheels
#
# Needs root and mmdebstrap (apt-get install mmdebstrap); 2.2 GB. The standard library is compiled from source, which is
# an unstable feature of cargo: the compiler and its source come from one Debian snapshot, so that they fit each other.
set -euo pipefail
tree="${1:?usage: $0 TREE}"
mirror=$(grep -h ^URIs /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1 | awk '{print $2}' || true)

packages=rustc,cargo,rust-src,python3-venv,gcc,libc6-dev,gcc-mingw-w64-x86-64-posix,llvm,ca-certificates
mmdebstrap --variant=apt --mode=root --aptopt='Acquire::Check-Valid-Until "false"' \
    --aptopt='APT::Install-Recommends "false"' --include="$packages" sid "$tree" "${mirror:-http://deb.debian.org/debian}"
# What this machine trusts and where it fetches from.
for file in /etc/ssl/certs/ca-certificates.crt /etc/pip.conf /root/.cargo/config.toml; do
    [ -e "$file" ] && install -D "$file" "$tree$file"
done
# Stripping a module for macOS signs it anew, with the tool that rustup would bring.
ln -sf llvm-objcopy "$tree/usr/bin/rust-objcopy"
chroot "$tree" python3 -m venv /venv
chroot "$tree" /venv/bin/pip install --quiet maturin==1.16.0 ziglang==0.17.1
chroot "$tree" rustc --version
