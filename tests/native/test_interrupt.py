"""Ctrl C during a call that takes long, in a process of its own."""

import os
import subprocess
import sys

import pytest

# A million vertices take seconds: several signals come before the call could end.
SCRIPT = """
import os, signal, sys, threading, time
import numpy as np, skinwright_native as native
n = 1000
x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
positions = np.stack([x.ravel(), y.ravel(), 0.3 * np.sin(9 * x.ravel())], axis=1).astype(np.float32)
k = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
triangles = np.concatenate([np.stack([k, k + 1, k + n], 1), np.stack([k + 1, k + n + 1, k + n], 1)]).astype(np.uint32)
small = positions[[0, n - 1, n * n - 1]], np.array([[0, 1, 2]], np.uint32)
weights = native.Weights(np.arange(4, dtype=np.uint32), np.zeros(3, np.uint32), np.ones(3, np.float32), 1)
calls = {
    "transfer": lambda: native.Source(*small, weights).transfer(positions, triangles),
    "embedding": lambda: native.biharmonic_embedding(positions, triangles, n_pairs=100),
    "job": lambda: native.Inpainting(native.Source(*small, weights), positions, triangles).start().result(),
}
seen = []


def handler(*_):
    seen.append(1)
    if len(seen) == 2:  # after the call a handler runs once, however many signals have come
        raise KeyboardInterrupt


def interrupt():
    while True:
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGINT)


signal.signal(signal.SIGINT, handler)
threading.Thread(target=interrupt, daemon=True).start()
try:
    calls[sys.argv[1]]()
    print("returned", flush=True)
    os._exit(0)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    os._exit(0)
"""


@pytest.mark.skipif(os.name == "nt", reason="a process cannot send itself Ctrl C there")
@pytest.mark.parametrize("call", ["transfer", "embedding", "job"])
def test_ctrl_c_stops_a_call_that_takes_long(call):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, call], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout == "interrupted\n", done.stderr
