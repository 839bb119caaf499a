"""Answers of the daemon, as values with units in their names."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

OVER = ("done", "stopped", "failed")

# A unit that was moved again after the exposure has this status: its position is not known.
MOVED_SINCE = "moved_since"


@dataclass(frozen=True)
class UnservedUnit:
    """A unit that did not, or would not, reach its target.

    `outcome` is refused, failed, stopped or unmeasured; `state` is what the unit does now.
    """

    unit_id: int
    outcome: str
    reason: str
    state: str = ""
    error_um: float | None = None

    def __str__(self) -> str:
        return f"unit {self.unit_id}: {self.outcome}" + (f": {self.reason}" if self.reason else "")


@dataclass(frozen=True)
class Plan:
    """The plan that `apply` of the same table would begin with. Nothing has moved.

    `served` of `targeted` units get to their targets; `moving` counts those that step aside, too.
    """

    targeted: int
    served: int
    moving: int
    makespan_s: float
    energy_J: float
    peak_power_W: float
    unserved: list[UnservedUnit]


@dataclass(frozen=True)
class Progress:
    """How far a configuration is. `state`: planning, uploading, moving, done, stopped or failed."""

    configuration: int
    state: str
    round: int
    targeted: int
    arrived: int
    refused: int
    failed: int
    makespan_s: float
    makespan_predicted_s: float

    def __str__(self) -> str:
        return f"round {self.round}: {self.state}, {self.arrived} of {self.targeted} arrived"


@dataclass(frozen=True)
class Measurement:
    """The finding of one exposure on one unit. Numbers that are not known are NaN, never 0.

    `status` is that of `focalfleet measurements` (docs/files.md); `x_mm`, `y_mm` is the measured
    fibre on the focal plane, `error_um` its distance from the target.
    """

    unit_id: int
    target_id: str
    target_x_mm: float
    target_y_mm: float
    x_mm: float
    y_mm: float
    sigma_um: float
    var_x_mm2: float
    cov_xy_mm2: float
    var_y_mm2: float
    error_um: float
    status: str
    source: str
    sensors: str
    alpha_deg: float
    beta_deg: float
    gamma_deg: float
    measured_utc: datetime


def whole(value: Any) -> int:
    """A count of an answer; 0 where it is missing."""
    return value if isinstance(value, int) else 0


def number(value: Any) -> float:
    """A number of an answer; NaN where it is missing."""
    return float(value) if isinstance(value, (int, float)) else math.nan


def text(value: Any) -> str:
    """A text of an answer; empty where it is missing."""
    return value if isinstance(value, str) else ""


def unserved_of(answer: dict[str, Any]) -> list[UnservedUnit]:
    """The units that the answer lists as not served."""
    return [
        UnservedUnit(
            unit_id=whole(row.get("unit_id")),
            outcome=text(row.get("outcome")),
            reason=text(row.get("reason")),
            state=text(row.get("state")),
            error_um=row.get("error_um"),
        )
        for row in answer.get("unserved") or []
    ]


def plan_of(answer: dict[str, Any]) -> Plan:
    """The preview that the daemon answers with."""
    return Plan(
        targeted=whole(answer.get("targeted")),
        served=whole(answer.get("served")),
        moving=whole(answer.get("moving")),
        makespan_s=number(answer.get("makespan_s")),
        energy_J=number(answer.get("energy_J")),
        peak_power_W=number(answer.get("peak_power_W")),
        unserved=unserved_of(answer),
    )


def progress_of(configuration: dict[str, Any]) -> Progress:
    """The progress that the configuration of a status shows."""
    return Progress(
        configuration=whole(configuration.get("id")),
        state=text(configuration.get("state")),
        round=whole(configuration.get("round")),
        targeted=whole(configuration.get("targeted")),
        arrived=whole(configuration.get("arrived")),
        refused=whole(configuration.get("refused")),
        failed=whole(configuration.get("failed")),
        makespan_s=number(configuration.get("makespan_s")),
        makespan_predicted_s=number(configuration.get("makespan_predicted_s")),
    )


def measurement_of(row: dict[str, Any]) -> Measurement:
    """A row of the answer to `measurements`."""
    moved_since = row.get("moved_since") is True
    # Without a spot the row has no position; that before a later move is not valid either.
    seen = number(row.get("sigma_um")) > 0 and not moved_since
    orientation = row.get("orientation") or {}

    def of_spot(name: str) -> float:
        return number(row.get(name)) if seen else math.nan

    return Measurement(
        unit_id=whole(row.get("unit_id")),
        target_id=text(row.get("target_id")),
        target_x_mm=number(row.get("target_x_mm")),
        target_y_mm=number(row.get("target_y_mm")),
        x_mm=of_spot("x_mm"),
        y_mm=of_spot("y_mm"),
        sigma_um=of_spot("sigma_um"),
        var_x_mm2=of_spot("var_x_mm2"),
        cov_xy_mm2=of_spot("cov_xy_mm2"),
        var_y_mm2=of_spot("var_y_mm2"),
        error_um=math.nan if moved_since else number(row.get("error_um")),
        status=MOVED_SINCE if moved_since else text(row.get("status")),
        source=text(row.get("source")),
        sensors=text(orientation.get("verdict")),
        alpha_deg=number(orientation.get("alpha_deg")),
        beta_deg=number(orientation.get("beta_deg")),
        gamma_deg=number(orientation.get("gamma_deg")),
        measured_utc=datetime.fromisoformat(text(row.get("at"))),
    )


def table_of(rows: list[Measurement], meta: dict[str, Any]) -> Any:
    """A QTable with units and meta, or the rows themselves where astropy is not installed."""
    try:
        from astropy.table import QTable
        from astropy.time import Time
        from astropy.units import Quantity
    except ImportError:
        return rows
    table = QTable(meta=meta)
    for field in fields(Measurement):
        column: Any = [getattr(row, field.name) for row in rows]
        unit = field.name.rsplit("_", 1)[-1]
        if unit in ("mm", "um", "deg", "mm2"):
            column = Quantity(column, unit)
        elif unit == "utc":
            days = [at.replace(tzinfo=None) for at in column]
            column = Time(days, format="datetime", scale="utc")
            column.format = "isot"
        table[field.name] = column
    return table
