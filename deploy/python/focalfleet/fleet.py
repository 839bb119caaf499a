"""The fleet, as a program sees it."""

from __future__ import annotations

import logging
import math
import os
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any

from focalfleet.control import Connection, socket_path
from focalfleet.errors import InvalidInput, NotServed, Refused, Stopped, TimedOut, Unreachable
from focalfleet.results import (
    OVER,
    Measurement,
    Plan,
    Progress,
    measurement_of,
    plan_of,
    progress_of,
    table_of,
    text,
    unserved_of,
    whole,
)
from focalfleet.tables import targets_csv
from focalfleet.version import __version__
from focalfleet.watching import updates

_log = logging.getLogger("focalfleet")

# The command-line tool takes a daemon that is silent for this long to hang.
SILENCE_S = 120.0
POLL_S = 0.5


class Fleet:
    """The fleet of one daemon.

    `socket` is the daemon's control socket; without it $FOCALFLEET_SOCKET, and without that
    /run/focalfleet/control.sock. A daemon that is silent for `timeout_s` seconds counts as
    unreachable. Several threads may share one object: requests follow one another, but `stop`
    has a connection of its own and waits for none.

    Use it as a context manager, or call `close` in the end. Neither ends a motion.
    """

    def __init__(
        self, socket: str | os.PathLike[str] | None = None, *, timeout_s: float = SILENCE_S
    ) -> None:
        if not 0 < timeout_s < math.inf:
            raise InvalidInput(f"timeout_s must be above 0 s and finite, not {timeout_s}")
        self._path = socket_path(socket)
        self._timeout_s = timeout_s
        self._connection = Connection(self._path, timeout_s)

    def __enter__(self) -> Fleet:
        try:
            self._connection.open()
        except BaseException:
            self._connection.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connection. A configuration under way goes on."""
        self._connection.close()

    # ---- commands

    def plan(self, targets: Any, *, fixed: bool = False) -> Plan:
        """Plans a configuration from where the units stand now. Nothing moves.

        `targets` and `fixed` are those of `apply`. Raises InvalidInput or Refused as `apply` would.
        """
        text_csv, source = targets_csv(targets)
        return plan_of(self._ask("preview", source=source, targets_csv=text_csv, fixed=fixed))

    def apply(
        self,
        targets: Any,
        *,
        fixed: bool = False,
        corrections: int | None = None,
        tolerance_um: float = 10.0,
    ) -> Job:
        """Moves the fleet to targets, and returns as soon as the daemon has begun.

        `targets` is an astropy table, a list of dicts or the path of a CSV file. Its columns, in
        any order and case: unit_id; x, y (lengths) or theta, phi (angles) with units, or x_mm, y_mm
        or theta_deg, phi_deg without; priority and target_id if wanted. A row whose place is masked
        (None in a dict) has no target.

        With `fixed`, units without a target may not step aside. With `corrections`, the camera
        measures the fibres, and those farther off than `tolerance_um` are corrected, at most so
        many times.

        Raises InvalidInput (the table is wrong: row and reason) or Refused; nothing moves then.
        """
        text_csv, source = targets_csv(targets)
        args: dict[str, Any] = {"source": source, "targets_csv": text_csv, "fixed": fixed}
        if corrections is not None:
            args |= {"corrections": corrections, "tolerance_um": tolerance_um}
        answer = self._ask("apply", wait=False, **args)
        return Job(self, whole(answer.get("configuration")))

    def stop(self, unit_id: int | None = None) -> str:
        """Stops one unit, or all; returns the daemon's sentence on what it did.

        The request has a connection of its own, ahead of all others.
        """
        connection = Connection(self._path, self._timeout_s)
        try:
            args = {} if unit_id is None else {"unit_id": int(unit_id)}
            return text(_object(connection.call("stop", **args)).get("text"))
        finally:
            connection.close()

    # ---- questions

    def status(self) -> dict[str, Any]:
        """The fleet, its buses and its configuration: `focalfleet status --json` in docs/cli.md."""
        return self._ask("status")

    def unit(self, unit_id: int) -> dict[str, Any]:
        """All that is known of one unit: `focalfleet unit --json` in docs/cli.md.

        Raises InvalidInput where there is no such unit.
        """
        return self._ask("unit", unit_id=int(unit_id))

    def history(self, unit_id: int | None = None, *, limit: int = 20) -> dict[str, Any]:
        """The newest configurations, or the newest moves of one unit, newest first."""
        args = {} if unit_id is None else {"unit_id": int(unit_id)}
        return self._ask("history", limit=int(limit), **args)

    def alarms(self, *, all: bool = False) -> dict[str, Any]:
        """Alarms that are open; with `all`, those that are over or acknowledged, too.

        The member `alarms` is a list; each has name, severity, state, unit_id, bus_id and text.
        """
        return self._ask("alarms", all=all)

    def measurements(self, exposure: int | None = None) -> Any:
        """The measurements of an exposure; without its number the newest of the configuration.

        An astropy QTable with the columns of `Measurement`, units (mm, um, deg) and `meta`
        (exposure, configuration, origin, version); without astropy the rows as a list.
        Raises Refused where nothing was measured.
        """
        answer = self._measurements(exposure)
        listed = answer.get("measurements") or []
        meta = {
            "exposure": whole(answer.get("exposure")),
            "configuration": whole(listed[0].get("configuration")) if listed else 0,
            "origin": "focalfleet",
            "version": __version__,
        }
        return table_of([measurement_of(row) for row in listed], meta)

    def measurement_rows(self, exposure: int | None = None) -> list[Measurement]:
        """The same as a list, whether astropy is installed or not."""
        listed = self._measurements(exposure).get("measurements") or []
        return [measurement_of(row) for row in listed]

    def watch(
        self,
        *,
        domain: int = 0,
        once: bool = False,
        wait_s: float = 5.0,
        program: str | os.PathLike[str] = "focalfleet",
    ) -> Iterator[dict[str, Any]]:
        """Each change of the fleet, live, as a dict with the members that changed.

        The status comes over DDS by the program `focalfleet watch --json`, which must be
        installed: Debian has no Python binding of Cyclone DDS. With `once`, the whole fleet comes
        as one dict. Raises Unreachable where no daemon publishes within `wait_s` seconds.
        """
        return updates(domain, once, wait_s, program)

    # ---- inside the package

    def _ask(self, verb: str, **args: Any) -> dict[str, Any]:
        try:
            return _object(self._connection.call(verb, **args))
        except InvalidInput as error:
            if str(error) == f"there is no verb '{verb}'":
                raise Refused(
                    f"this daemon is too old for {verb}; the package has version {__version__}"
                ) from error
            raise

    def _measurements(self, exposure: int | None) -> dict[str, Any]:
        args = {} if exposure is None else {"exposure": int(exposure)}
        return self._ask("measurements", **args)


class Job:
    """A configuration that was begun, and that goes on whether anybody waits or not."""

    def __init__(self, fleet: Fleet, configuration: int) -> None:
        self._fleet = fleet
        self.configuration = configuration

    def __repr__(self) -> str:
        return f"Job(configuration={self.configuration})"

    def progress(self) -> Progress:
        """How far it is now."""
        return progress_of(self._look(math.inf))

    def wait(
        self,
        progress: Callable[[Progress], object] | None = None,
        timeout: float | None = None,
        *,
        poll_s: float = POLL_S,
        check: bool = True,
    ) -> dict[str, Any]:
        """Waits until the configuration is over, and returns its figures (docs/cli.md, `apply`).

        `progress` is called with each change of the progress. Raises NotServed with the list where
        units did not arrive, Stopped where it was stopped or failed (neither with `check=False`),
        TimedOut after `timeout` seconds, and Unreachable where the daemon is gone. Whatever ends
        the wait, Ctrl-C included, the fleet goes on, and a second call waits again.
        """
        until = math.inf if timeout is None else time.monotonic() + timeout
        last: Progress | None = None
        try:
            while True:
                found = self._look(until)
                now = progress_of(found)
                if progress is not None and now != last:
                    progress(now)
                last = now
                if now.state in OVER:
                    return self._outcome(found) if check else found
                if time.monotonic() >= until:
                    raise TimedOut("")
                time.sleep(max(min(poll_s, until - time.monotonic()), 0))
        except (TimedOut, Unreachable):
            if time.monotonic() < until:
                raise
            raise TimedOut(
                f"configuration {self.configuration} is not over after {timeout:g} s; it goes on"
            ) from None
        except KeyboardInterrupt as interrupt:
            note = (
                f"no longer waiting; configuration {self.configuration} goes on "
                "(Fleet.stop() ends it, Fleet.status() shows it)"
            )
            _log.warning(note)
            interrupt.add_note(note)
            raise

    def _look(self, until: float) -> dict[str, Any]:
        """The configuration as the daemon knows it; `until` is an instant of time.monotonic()."""
        left_s = max(until - time.monotonic(), 0.001)
        status = _object(self._fleet._connection.call("status", timeout_s=left_s))
        found = status.get("configuration") or {}
        if whole(found.get("id")) == self.configuration:
            return dict(found)
        # Another configuration came after it, and the store has what became of this one.
        for row in self._fleet.history(limit=1000).get("configurations") or []:
            if whole(row.get("id")) == self.configuration:
                return dict(row)
        raise Stopped(f"the daemon knows nothing of configuration {self.configuration}")

    def _outcome(self, found: dict[str, Any]) -> dict[str, Any]:
        state = text(found.get("state"))
        arrived, targeted = whole(found.get("arrived")), whole(found.get("targeted"))
        said = f"configuration {self.configuration}: {state}, {arrived} of {targeted} units arrived"
        if state != "done":
            raise Stopped(said, found)
        if arrived == targeted:
            return found
        unserved = unserved_of(found)
        shown = "".join(f"\n  {unit}" for unit in unserved[:5])
        more = f"\n  and {len(unserved) - 5} more" if len(unserved) > 5 else ""
        raise NotServed(said + shown + more, unserved, found)


def _object(answer: Any) -> dict[str, Any]:
    if not isinstance(answer, dict):
        raise Unreachable(f"the answer is no object: {ascii(answer)[:80]}")
    return answer
