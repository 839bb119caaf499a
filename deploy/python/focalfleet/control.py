"""Requests and answers of the control socket: one JSON object a line.

    request   {"id":1,"verb":"unit","args":{"unit_id":7}}
    answer    {"id":1,"ok":true,"result":{...}}  or  {"id":1,"ok":false,"error":{"code","text"}}

daemon/control/messages.h describes the messages.
"""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from typing import Any

from focalfleet.errors import FocalfleetError, InvalidInput, Refused, Stopped, Unreachable

DEFAULT_SOCKET = "/run/focalfleet/control.sock"

# The daemon reads no longer request, except for models (limits.h: kControlLineBytes and
# kModelLineBytes).
REQUEST_BYTES_MAX = 2 << 20
MODEL_BYTES_MAX = 16 << 20
# The state of 32,768 units, the most of a fleet, has some 20 MB. Ten times that is no answer.
ANSWER_BYTES_MAX = 256 << 20
CHUNK_BYTES = 1 << 20

# Only these verbs may be asked again without harm after a connection broke.
_QUESTIONS = frozenset(
    "status unit state history params measurements model alarms events select preview".split()
)


def socket_path(path: str | os.PathLike[str] | None) -> str:
    """The path given, else $FOCALFLEET_SOCKET, else that of the installed daemon."""
    return os.fspath(path) if path else os.environ.get("FOCALFLEET_SOCKET") or DEFAULT_SOCKET


class Broken(Exception):
    """The connection cannot be used any more, for a reason."""


class Connection:
    """A connection to the daemon, opened when it is needed and again after it broke.

    Several threads may share it: a request waits until the one before it is answered.
    """

    def __init__(self, path: str, timeout_s: float) -> None:
        self.path = path
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._received = bytearray()
        self._last_id = 0

    def open(self) -> None:
        """Connects. Raises Unreachable where no daemon listens."""
        with self._lock:
            self._connect()

    def close(self) -> None:
        """Closes the connection after the request under way."""
        with self._lock:
            self._drop()

    def call(self, verb: str, timeout_s: float | None = None, **args: Any) -> Any:
        """The result of one request.

        Raises Refused or InvalidInput by the daemon's answer. Where no answer comes, a question
        raises Unreachable, and a command raises Stopped, because its effect is not known.
        """
        silence_s = self._timeout_s if timeout_s is None else min(timeout_s, self._timeout_s)
        with self._lock:
            self._connect()
            self._last_id += 1
            line = _encoded(self._last_id, verb, args)
            try:
                self._send(line, silence_s)
                answer = self._answer(silence_s)
            except (OSError, Broken) as error:
                self._drop()
                raise _lost(verb, self._why(error, silence_s)) from error
            except BaseException as error:
                # The rest of the answer may still come: it must not meet the next request.
                self._drop()
                if verb not in _QUESTIONS:
                    error.add_note(_unknown_effect(verb))
                raise
        if answer.get("ok") is True:
            return answer.get("result")
        raise _failure(answer.get("error"))

    def _connect(self) -> None:
        if self._socket is not None:
            return
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        try:
            connection.settimeout(self._timeout_s)
            connection.connect(self.path)
        except OSError as error:
            connection.close()
            raise Unreachable(
                f"{self.path}: {self._why(error, self._timeout_s)}; is focalfleetd running, and is "
                "this its socket (socket=, $FOCALFLEET_SOCKET)?"
            ) from error
        except BaseException:
            connection.close()
            raise
        self._received.clear()
        self._socket = connection

    def _drop(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None
        self._received.clear()

    def _send(self, line: bytes, silence_s: float) -> None:
        assert self._socket is not None
        self._socket.settimeout(silence_s)
        self._socket.sendall(line)

    def _answer(self, silence_s: float) -> dict[str, Any]:
        """The answer to the last request. Raises Broken where the line is none."""
        # Progress is passed over, but it does not extend the time.
        until = time.monotonic() + silence_s
        while True:
            line = self._line(until)
            try:
                answer = json.loads(line)
            except (ValueError, RecursionError) as error:
                raise Broken(f"the answer is not JSON: {_shown(line)}") from error
            if not isinstance(answer, dict) or not isinstance(answer.get("id"), int):
                raise Broken(f"the answer has no number: {_shown(line)}")
            # A line that could not be read at all is answered under number 0.
            if answer["id"] not in (0, self._last_id):
                raise Broken(f"the answer belongs to another request: {_shown(line)}")
            if "progress" not in answer:
                return answer

    def _line(self, until: float) -> bytes:
        assert self._socket is not None
        searched = 0
        while (end := self._received.find(b"\n", searched)) < 0:
            searched = len(self._received)
            if searched > ANSWER_BYTES_MAX:
                raise Broken(f"the answer is longer than {ANSWER_BYTES_MAX >> 20} MiB")
            left_s = until - time.monotonic()
            if left_s <= 0:
                raise TimeoutError
            self._socket.settimeout(left_s)
            chunk = self._socket.recv(CHUNK_BYTES)
            if not chunk:
                raise Broken("the daemon closed the connection")
            self._received += chunk
        line = bytes(self._received[:end])
        del self._received[: end + 1]
        return line

    @staticmethod
    def _why(error: Exception, silence_s: float) -> str:
        if isinstance(error, TimeoutError):
            return f"no answer within {silence_s:g} s"
        if isinstance(error, OSError):
            return error.strerror or str(error)
        return str(error)


def _encoded(number: int, verb: str, args: dict[str, Any]) -> bytes:
    try:
        text = json.dumps(
            {"id": number, "verb": verb, "args": args}, ensure_ascii=False, allow_nan=False
        )
        line = text.encode() + b"\n"
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{verb}: an argument cannot be sent: {error}") from error
    most = MODEL_BYTES_MAX if verb == "model_load" else REQUEST_BYTES_MAX
    if len(line) > most:
        raise InvalidInput(
            f"{verb}: the request has {len(line)} bytes; the daemon takes at most {most}"
        )
    return line


def _shown(line: bytes) -> str:
    return ascii(line[:80].decode(errors="replace"))


def _unknown_effect(verb: str) -> str:
    return f"whether `{verb}` took effect is not known: look at Fleet.status()"


def _lost(verb: str, why: str) -> FocalfleetError:
    if verb in _QUESTIONS:
        return Unreachable(
            f"{why}; units that move go on by themselves (`focalfleet stop --direct` stops them "
            "without the daemon)"
        )
    return Stopped(f"{why}; {_unknown_effect(verb)}")


def _failure(error: Any) -> FocalfleetError:
    known = error if isinstance(error, dict) else {}
    code = known.get("code")
    text = str(known.get("text") or "no reason given")
    if code == "invalid":
        return InvalidInput(text)
    if code in ("refused", "full", "newer"):
        return Refused(text)
    return Stopped(text)
