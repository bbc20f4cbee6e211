"""Every built wheel, as far as its bytes tell: names, architecture, what it asks of the system, macOS' signature.

They are those of dist/wheels (`make wheels`); no foreign system is needed to read them.
"""

import hashlib
import re
import struct
import zipfile
from pathlib import Path

import platforms
import pytest

ROOT = Path(__file__).resolve().parent.parent
WHEELS = sorted((ROOT / "dist" / "wheels").glob("*.whl"))
STUB = ROOT / "rust" / "native" / "skinwright_native.pyi"
lief = pytest.importorskip("lief", reason="needs lief to read foreign modules")

ARCHITECTURE = {
    "linux-x64": lief.ELF.ARCH.X86_64,
    "linux-arm64": lief.ELF.ARCH.AARCH64,
    "windows-x64": lief.PE.Header.MACHINE_TYPES.AMD64,
    "windows-arm64": lief.PE.Header.MACHINE_TYPES.ARM64,
    "macos-x64": lief.MachO.Header.CPU_TYPE.X86_64,
    "macos-arm64": lief.MachO.Header.CPU_TYPE.ARM64,
}
LINUX_LIBRARIES = re.compile(r"lib(c|m|gcc_s|pthread|dl|rt)\.so\.\d+|ld-linux-(x86-64|aarch64)\.so\.\d")
MACOS_LIBRARIES = re.compile(r"/usr/lib/lib(System\.B|iconv\.2|charset\.1|c\+\+\.1)\.dylib")
WINDOWS_LIBRARIES = re.compile(
    r"(kernel32|ntdll|msvcrt|bcryptprimitives|python3|userenv|ws2_32|ucrtbase|api-ms-win-[a-z0-9-]+)\.dll",
    re.IGNORECASE,
)
OLDEST_MACOS = {"macos-arm64": [11, 0, 0], "macos-x64": [10, 12, 0]}

if not WHEELS:
    pytest.skip("there is no wheel in dist/wheels: run make wheels", allow_module_level=True)


@pytest.fixture(params=WHEELS, ids=lambda wheel: wheel.name)
def wheel(request):
    return request.param


@pytest.fixture
def platform(wheel):
    return platforms.of_wheel(wheel.name).name


@pytest.fixture
def module(wheel):
    """Bytes of the only binary in the wheel."""
    with zipfile.ZipFile(wheel) as archive:
        assert archive.testzip() is None
        (name,) = [name for name in archive.namelist() if name.endswith((".so", ".pyd"))]
        return archive.read(name)


def parsed(module):
    binary = lief.parse(module)
    return binary.at(0) if isinstance(binary, lief.MachO.FatBinary) else binary


def test_the_name_says_abi3_and_the_version(wheel):
    assert re.fullmatch(r"skinwright_native-\d+\.\d+\.\d+-cp311-abi3-\w+\.whl", wheel.name)


def test_what_is_published_with_it(wheel):
    """The stub, the licence and what a package index shows are inside."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        metadata = next(archive.read(name).decode() for name in names if name.endswith("METADATA"))
        stub = archive.read("skinwright_native/__init__.pyi").decode()
    assert stub == STUB.read_text(encoding="utf-8")
    assert "skinwright_native/py.typed" in names
    assert any("LICENSE" in name for name in names)
    assert "Requires-Python: >=3.11" in metadata
    assert "Description-Content-Type: text/markdown" in metadata
    assert "Classifier: " in metadata


def test_no_folder_of_the_builder_is_inside(module):
    assert not re.findall(rb"/(?:root|home|work|Users|checkout)/[\w.-]*", module)


def test_the_architecture(platform, module):
    binary = parsed(module)
    header = binary.header
    found = header.machine if platform.startswith("windows") else getattr(header, "machine_type", None)
    assert (header.cpu_type if platform.startswith("macos") else found) == ARCHITECTURE[platform]


def test_the_entry_point_is_exported(platform, module):
    binary = parsed(module)  # lief's symbols do not keep it alive
    exported = {symbol.name.removeprefix("_") for symbol in exported_symbols(platform, binary)}
    assert "PyInit_skinwright_native" in exported


def exported_symbols(platform, binary):
    return binary.get_export().entries if platform.startswith("windows") else binary.exported_symbols


def test_only_libraries_of_the_system(platform, module):
    allowed = {"linux": LINUX_LIBRARIES, "macos": MACOS_LIBRARIES, "windows": WINDOWS_LIBRARIES}[platform.split("-")[0]]
    binary = parsed(module)
    needed = [getattr(library, "name", library) for library in binary.libraries]
    assert needed and not [name for name in needed if "skinwright" not in name and not allowed.fullmatch(name)]


def test_any_glibc_since_2_28(platform, module):
    if not platform.startswith("linux"):
        pytest.skip("not for Linux")
    versions = {tuple(map(int, found.split(b"."))) for found in re.findall(rb"GLIBC_(\d+\.\d+)", module)}
    assert versions and max(versions) <= (2, 28)


def test_the_oldest_macos(platform, module):
    if not platform.startswith("macos"):
        pytest.skip("not for macOS")
    binary = parsed(module)
    oldest = binary.build_version.minos if binary.has_build_version else binary.version_min.version
    assert oldest == OLDEST_MACOS[platform]


def test_every_page_agrees_with_the_signature(platform, module):
    """macOS on ARM ends a process whose signed pages differ; the directory of hashes is Apple's code signing format."""
    if platform != "macos-arm64":
        pytest.skip("signed for macOS on ARM only")
    at, commands, offset = 32, struct.unpack_from("<I", module, 16)[0], None
    for _ in range(commands):
        command, size = struct.unpack_from("<II", module, at)
        offset = struct.unpack_from("<I", module, at + 8)[0] if command == 0x1D else offset
        at += size
    assert offset is not None, "there is no signature"
    blobs = struct.unpack_from(">I", module, offset + 8)[0]
    places = dict(struct.unpack_from(">II", module, offset + 12 + 8 * i) for i in range(blobs))
    directory = offset + places[0]
    hashes, limit = (
        struct.unpack_from(">I", module, directory + 16)[0],
        struct.unpack_from(">I", module, directory + 32)[0],
    )
    pages, size = struct.unpack_from(">I", module, directory + 28)[0], 1 << module[directory + 39]
    assert limit == offset and pages == -(-limit // size)
    for page in range(pages):
        digest = hashlib.sha256(module[page * size : min((page + 1) * size, limit)]).digest()
        stored = directory + hashes + 32 * page
        assert digest == module[stored : stored + 32], f"page {page}"
