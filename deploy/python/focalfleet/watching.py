"""Live status by the program `focalfleet watch --json`.

Debian has no Python binding of Cyclone DDS, so the status that the daemon publishes over DDS is
read by the command-line tool, and this package reads its lines.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from typing import Any

from focalfleet.errors import FocalfleetError, Refused, Stopped, Unreachable


def updates(
    domain: int, once: bool, wait_s: float, program: str | os.PathLike[str]
) -> Iterator[dict[str, Any]]:
    """Each change of the fleet, as the program prints it, until the caller stops iterating."""
    command = [os.fspath(program), "watch", "--json", f"--domain={domain}", f"--wait={wait_s}"]
    if once:
        command.append("--once")
    try:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
    except OSError as error:
        raise Unreachable(f"{command[0]}: {error.strerror}; watch() needs this program") from error
    # The error text of `watch` is a few lines, so its pipe never fills.
    with process:
        assert process.stdout is not None and process.stderr is not None
        try:
            said = ""
            for line in process.stdout:
                update = _object(line)
                if isinstance(update.get("error"), dict):
                    said = str(update["error"].get("text"))
                else:
                    yield update
            process.wait()
        finally:
            process.terminate()
        if process.returncode != 0:
            said = said or process.stderr.read().decode(errors="replace").strip()
            raise _failure(process.returncode, said or f"`watch` ended with {process.returncode}")


def _object(line: bytes) -> dict[str, Any]:
    try:
        update = json.loads(line)
    except ValueError as error:
        raise Stopped(f"`watch` printed no JSON: {ascii(line[:80])}") from error
    if not isinstance(update, dict):
        raise Stopped(f"`watch` printed no object: {ascii(line[:80])}")
    return update


def _failure(exit_code: int, text: str) -> FocalfleetError:
    if exit_code in (Refused.exit_code, 2):
        return Refused(text)
    return Unreachable(text) if exit_code == Unreachable.exit_code else Stopped(text)
