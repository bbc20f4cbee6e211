"""What a table says of the machine it was made on."""

import os
import platform
from pathlib import Path


def processor() -> str:
    """The processor's name, or its architecture where Linux does not tell."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def described(load: float) -> str:
    """Processor, cores, system, and the `load` before the run."""
    return f"{processor()}, {os.cpu_count()} cores,\n{platform.platform()}; load before the run {load:.1f}."
