"""The table of platforms: Blender's name of each, and how its wheel is built and known again."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Platform:
    """A system that Blender runs on.

    `target` is Rust's name for it, `tag` the end of its wheel's file name, `options` are maturin's. The linker of
    mingw-w64 is named by a variable of cargo's; everything else is linked by zig, which brings the system libraries'
    symbols itself.
    """

    name: str
    target: str
    tag: str
    options: tuple[str, ...] = ("--zig",)
    linker: str = ""

    @property
    def environment(self) -> dict[str, str]:
        """What cargo must be told besides its arguments."""
        if not self.linker:
            return {}
        return {f"CARGO_TARGET_{self.target.upper().replace('-', '_')}_LINKER": self.linker}


GLIBC = ("--zig", "--compatibility", "manylinux_2_28")

PLATFORMS = {
    platform.name: platform
    for platform in (
        Platform("linux-x64", "x86_64-unknown-linux-gnu", "manylinux_2_28_x86_64", GLIBC),
        Platform("windows-x64", "x86_64-pc-windows-gnu", "win_amd64", (), "x86_64-w64-mingw32-gcc"),
        Platform("macos-arm64", "aarch64-apple-darwin", "macosx_11_0_arm64"),
        Platform("macos-x64", "x86_64-apple-darwin", "macosx_10_12_x86_64"),
        Platform("windows-arm64", "aarch64-pc-windows-gnullvm", "win_arm64"),
        Platform("linux-arm64", "aarch64-unknown-linux-gnu", "manylinux_2_28_aarch64", GLIBC),
    )
}


def of_wheel(name: str) -> Platform:
    """The platform that the file name of a wheel belongs to."""
    for platform in PLATFORMS.values():
        if name.endswith(f"{platform.tag}.whl"):
            return platform
    raise ValueError(f"{name} fits none of the platforms {', '.join(PLATFORMS)}")
