"""Messages between processes: JSON objects, one a line."""

from __future__ import annotations

import json
import os
import queue
import threading
import time
from typing import IO, Any

from kfcourse.exercises.grading.values import LARGEST, ProtocolError


def close_streams() -> None:
    """Nothing reads standard input any more, or writes to output and errors."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)


class Closed(EOFError):
    """Nobody is at the other end any more."""


class Channel:
    """Sends and receives, each from one thread at a time."""

    def __init__(self, source: IO[bytes], sink: IO[bytes]):
        self._source, self._sink = source, sink

    def send(self, message: dict[str, Any]) -> None:
        """Closed if nobody is there to receive."""
        data = json.dumps(message).encode()
        if len(data) > LARGEST:
            raise ValueError(f"a value of more than {LARGEST // 2**20} MB")
        try:
            self._sink.write(data + b"\n")
            self._sink.flush()
        except (OSError, ValueError):
            raise Closed from None

    def receive(self) -> dict[str, Any]:
        """The next message; Closed at the end, ProtocolError if it is none of ours."""
        try:
            line = self._source.readline(LARGEST + 1)
        except (OSError, ValueError):
            raise Closed from None
        if len(line) > LARGEST:
            raise ProtocolError("a message without end")
        if not line.endswith(b"\n"):
            raise Closed
        try:
            message = json.loads(line)
        except (ValueError, RecursionError):
            raise ProtocolError("a message that is not JSON") from None
        if not isinstance(message, dict):
            raise ProtocolError("a message that is no object")
        return message


class PatientChannel(Channel):
    """A channel that waits no longer than it is told, on every system: a thread of its own
    receives.  The thread is a daemon: what has escaped may hold the pipe open for ever."""

    def __init__(self, source: IO[bytes], sink: IO[bytes]):
        super().__init__(source, sink)
        # a flood waits in the pipe
        self._queue: queue.Queue[dict[str, Any] | Exception] = queue.Queue(maxsize=100)
        threading.Thread(target=self._forward, daemon=True).start()

    def _forward(self) -> None:
        try:
            while True:
                self._queue.put(self.receive())
        except Exception as error:
            self._queue.put(error)

    def wait(self, until: float) -> dict[str, Any]:
        """The next message; TimeoutError if none is there at that time of `time.monotonic`."""
        try:
            message = self._queue.get(timeout=max(until - time.monotonic(), 0.0))
        except queue.Empty:
            raise TimeoutError from None
        if isinstance(message, Exception):
            raise message
        return message
