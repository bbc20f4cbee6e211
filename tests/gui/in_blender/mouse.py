"""The mouse of the virtual screen. Its events come from the X server and wake Blender as an artist's do.

Simulated events differ where it matters when a stroke ends: with them Blender's loop never sleeps, and they are queued
behind the events of timers, not before them.
"""

from __future__ import annotations

import os
import socket
import struct

from driver import Steps

MOTION, PRESS, RELEASE = 6, 4, 5


class Mouse:
    """Left button only; coordinates as in driver.Window. What it does has reached the X server's queues on return."""

    def __init__(self) -> None:
        self.server = socket.socket(socket.AF_UNIX)
        self.server.connect(f"/tmp/.X11-unix/X{os.environ['DISPLAY'].removeprefix(':')}")
        self.server.sendall(struct.pack("<cxHHHHxx", b"l", 11, 0, 0, 0))
        accepted, units = struct.unpack("<BxxxxxH", self.read(8))
        setup = self.read(4 * units)
        if accepted != 1:
            raise RuntimeError(f"the X server refuses: {setup!r}")
        # The first screen stands after the vendor's name, padded to four bytes, and the pixel formats.
        screen = 32 + (struct.unpack_from("<H", setup, 16)[0] + 3 & ~3) + 8 * setup[21]
        self.root, self.height = (
            struct.unpack_from("<I", setup, screen)[0],
            struct.unpack_from("<H", setup, screen + 22)[0],
        )
        self.server.sendall(struct.pack("<BxHHxx8s", 98, 4, 5, b"XTEST"))
        present, self.extension = struct.unpack_from("<BB", self.reply(), 8)
        if not present:
            raise RuntimeError("the X server has no XTEST extension")

    def read(self, size: int) -> bytes:
        received = b""
        while len(received) < size:
            received += self.server.recv(size - len(received))
        return received

    def reply(self) -> bytes:
        """The answer to the last question; events that every client gets are passed over."""
        while (packet := self.read(32))[0] > 1:
            pass
        if packet[0] == 0:
            raise RuntimeError(f"the X server reports error {packet[1]}")
        return packet

    def act(self, kind: int, detail: int, x: int = 0, y: int = 0) -> None:
        """A request of XTEST, and a question whose answer tells that it has been dealt with."""
        self.server.sendall(struct.pack("<BBHBBxxII8xhh8x", self.extension, 2, 9, kind, detail, 0, self.root, x, y))
        self.server.sendall(struct.pack("<BxH", 43, 1))
        self.reply()

    def move(self, at: tuple[int, int]) -> None:
        self.act(MOTION, 0, int(at[0]), self.height - 1 - int(at[1]))

    def press(self) -> None:
        self.act(PRESS, 1)

    def release(self) -> None:
        self.act(RELEASE, 1)

    def drag(self, path: list[tuple[int, int]], seconds: float = 0.06) -> Steps:
        """Press at the first point and move along; the button stays down."""
        self.move(path[0])
        yield 0.3
        self.press()
        for point in path:
            yield seconds
            self.move(point)
