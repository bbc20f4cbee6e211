"""What every fuzzer has: arguments, a clock, seeds that replay, and a count of what was tried and found."""

import argparse
import collections
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator

import numpy as np

# Nothing that an artist or a caller may see holds one of these.
NEVER = ("Traceback", "Internal error", "internal error", "PanicException")


class Run:
    """One fuzzer's run. Each case has a seed of its own: `--first SEED --cases 1` replays it."""

    def __init__(self, name: str, cases: int) -> None:
        parser = argparse.ArgumentParser(description=name)
        parser.add_argument("--seconds", type=float, default=60, help="stop after this long")
        parser.add_argument("--cases", type=int, default=cases, help="stop after so many cases")
        parser.add_argument("--first", type=int, default=0, help="seed of the first case")
        options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
        self.name, self.seconds, self.n_cases, self.first = name, options.seconds, options.cases, options.first
        self.outcomes: collections.Counter[str] = collections.Counter()
        self.findings: list[str] = []

    def cases(self) -> Iterator[tuple[int, np.random.Generator]]:
        """Seeds with their generators, until time or number is up."""
        end = time.perf_counter() + self.seconds
        for seed in range(self.first, self.first + self.n_cases):
            if time.perf_counter() > end or len(self.findings) >= 20:
                return
            yield seed, np.random.default_rng(seed)

    def attempt(self, seed: int, what: str, call: Callable[..., str], *arguments: object) -> None:
        """Count what a case comes to; an assertion that fails or any exception from `call` is a finding."""
        try:
            self.outcomes[f"{what}: {call(*arguments)}"] += 1
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            self.found(seed, what, f"{type(error).__name__}: {error}")
            traceback.print_exc()

    def found(self, seed: int, what: str, problem: str) -> None:
        """Note a finding, with the seed that replays it."""
        self.findings.append(f"seed {seed}, {what}: {problem}")

    def end(self) -> None:
        """Print the counts and leave; some bpy wheels hang or crash in Python's ordinary exit."""
        for outcome, count in sorted(self.outcomes.items()):
            print(f"  {count:6d}  {outcome}")
        for finding in self.findings:
            print(f"  FOUND  {finding[:600]}")
        print(f"{self.name}: {sum(self.outcomes.values())} cases, {len(self.findings)} findings", flush=True)
        sys.stderr.flush()
        os._exit(1 if self.findings else 0)
