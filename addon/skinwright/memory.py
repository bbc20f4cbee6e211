"""How much memory is free, from the system itself; no number is as good as a guess, so None where it does not say."""

import ctypes
import sys
from pathlib import Path

from .errors import Refused

# The part of the free memory that one piece of work may take; the preferences set it.
share = 0.5


class TooLarge(Refused):
    """Work that would take more memory than it may."""


def budget() -> int | None:
    """Bytes that one piece of work may take now."""
    free = free_bytes()
    return None if free is None else int(free * share)


def expect(work: str, size: int) -> None:
    """Raise TooLarge with the estimate if `work` would take more than its share of `size` bytes."""
    allowed = budget()
    if allowed is not None and size > allowed:
        raise TooLarge(
            f"{work} would take about {size >> 20} MiB of memory, and {allowed >> 20} are allowed: "
            "do less at once, close other programs, or allow more in the preferences"
        )


def free_bytes() -> int | None:
    """Bytes that can be had without swapping."""
    try:
        if sys.platform == "linux":
            return _linux()
        return _windows() if sys.platform == "win32" else _unix()
    except (OSError, ValueError, AttributeError):
        return None


def _linux() -> int | None:
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    return None


def _unix() -> int:
    """macOS keeps hardly any page free: count half of what there is."""
    import os

    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of Windows."""

    _fields_ = [
        ("length", ctypes.c_uint32),
        ("load", ctypes.c_uint32),
        *((name, ctypes.c_uint64) for name in ("total", "available", "total_page", "available_page")),
        *((name, ctypes.c_uint64) for name in ("total_virtual", "available_virtual", "extended")),
    ]


def _windows() -> int | None:
    status = _MemoryStatus()
    status.length = ctypes.sizeof(status)
    library = getattr(ctypes, "windll").kernel32  # noqa: B009 (mypy knows it on Windows only)
    return int(status.available) if library.GlobalMemoryStatusEx(ctypes.byref(status)) else None
