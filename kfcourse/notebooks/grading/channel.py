"""Messages between processes: JSON objects, each after its length."""

from __future__ import annotations

import json
import queue
import struct
import threading
import time
from collections.abc import Callable
from typing import IO, Any

from kfcourse.notebooks.grading.values import LARGEST, Strange

LENGTH = struct.Struct(">Q")


class Closed(EOFError):
    """Nobody is at the other end any more."""


class Late(Exception):
    """Nothing came in time."""


class Channel:
    """Sends and receives; any thread may send, one receives."""

    def __init__(self, source: IO[bytes], sink: IO[bytes]):
        self._source, self._sink, self._sending = source, sink, threading.RLock()

    def send(self, message: dict[str, Any]) -> None:
        """Closed if nobody is there to receive."""
        data = json.dumps(message).encode()
        if len(data) > LARGEST:
            raise ValueError(f"a value of more than {LARGEST // 2**20} MB")
        with self._sending:
            try:
                self._sink.write(LENGTH.pack(len(data)) + data)
                self._sink.flush()
            except (OSError, ValueError):
                raise Closed from None

    def receive(self) -> dict[str, Any]:
        """The next message; Closed at the end, Strange if it is none of ours."""
        (length,) = LENGTH.unpack(self._read(LENGTH.size))
        if length > LARGEST:
            raise Strange(f"a message of {length} bytes")
        try:
            message = json.loads(self._read(length))
        except (ValueError, RecursionError):
            raise Strange("a message that is not JSON") from None
        if not isinstance(message, dict):
            raise Strange("a message that is no object")
        return message

    def _read(self, count: int) -> bytes:
        try:
            data = self._source.read(count)
        except (OSError, ValueError):
            raise Closed from None
        if len(data) < count:
            raise Closed
        return data


class Patient(Channel):
    """A channel that waits no longer than it is told, on every system: a thread of its own receives."""

    def __init__(self, source: IO[bytes], sink: IO[bytes]):
        super().__init__(source, sink)
        self._queue: queue.Queue[dict[str, Any] | Exception] = queue.Queue(maxsize=100)  # a flood waits in the pipe
        threading.Thread(target=self._forward, daemon=True).start()

    def _forward(self) -> None:
        while True:
            try:
                self._queue.put(super().receive())
            except Exception as error:
                self._queue.put(error)
                return

    def wait(self, until: float, alive: Callable[[], None] = lambda: None) -> dict[str, Any]:
        """The next message; Late if none is there at that time of `time.monotonic`.  `alive` raises if waiting is in vain."""
        while True:
            left = until - time.monotonic()
            if left <= 0:
                raise Late
            try:
                found = self._queue.get(timeout=min(left, 0.5))
            except queue.Empty:
                alive()
                continue
            if isinstance(found, Exception):
                raise found
            return found
