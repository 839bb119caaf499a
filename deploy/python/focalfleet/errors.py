"""Exceptions, one for each exit code of the command-line tool that means a failure.

`exit_code` is the number with which `focalfleet` ends for the same reason (docs/cli.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from focalfleet.results import UnservedUnit


class FocalfleetError(Exception):
    """Anything that a call of this package can fail with, besides errors of the caller's own code."""

    exit_code = 5


class Refused(FocalfleetError):
    """The daemon refused the request; nothing changed."""

    exit_code = 1


class InvalidInput(Refused, ValueError):
    """A table or an argument is wrong; the text names row and reason. Nothing changed."""


class NotServed(FocalfleetError):
    """The configuration is over, but some units did not reach their targets.

    `unserved` lists them; `configuration` has all figures.
    """

    exit_code = 3

    def __init__(
        self, text: str, unserved: list[UnservedUnit], configuration: dict[str, Any]
    ) -> None:
        super().__init__(text)
        self.unserved = unserved
        self.configuration = configuration


class Unreachable(FocalfleetError):
    """The daemon does not answer. Units that move go on by themselves."""

    exit_code = 4


class Stopped(FocalfleetError):
    """The configuration was stopped or failed on the way, or the effect of a command is not known.

    `configuration` has all figures, where they are known.
    """

    exit_code = 5

    def __init__(self, text: str, configuration: dict[str, Any] | None = None) -> None:
        super().__init__(text)
        self.configuration: dict[str, Any] = configuration or {}


class TimedOut(FocalfleetError, TimeoutError):
    """The wait took longer than allowed. The configuration goes on."""

    exit_code = 1
