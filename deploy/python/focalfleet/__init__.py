"""Client of focalfleetd, which moves the fibres of a telescope's focal plane.

    with Fleet() as fleet:
        job = fleet.apply(table)
        job.wait(progress=print)
        measured = fleet.measurements()

Lengths are in mm (errors in um), angles in degrees, times in seconds. docs/python.md is the how-to.
"""

from focalfleet.errors import (
    FocalfleetError,
    InvalidInput,
    NotServed,
    Refused,
    Stopped,
    TimedOut,
    Unreachable,
)
from focalfleet.fleet import Fleet, Job
from focalfleet.results import Measurement, Plan, Progress, UnservedUnit
from focalfleet.version import __version__

__all__ = [
    "Fleet",
    "FocalfleetError",
    "InvalidInput",
    "Job",
    "Measurement",
    "NotServed",
    "Plan",
    "Progress",
    "Refused",
    "Stopped",
    "TimedOut",
    "Unreachable",
    "UnservedUnit",
    "__version__",
]
