"""Targets as the daemon's CSV.

Only names and units are understood here. Whether a unit exists, its target is in reach or a column
is missing is for the daemon to say. Row k (from 0) of a table is line k + 2 of the daemon's text,
because a row without a target becomes a comment.
"""

from __future__ import annotations

import csv
import io
import math
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from focalfleet.errors import InvalidInput

# A column with a unit of its own may go without the unit in its name.
_PLACES = {"x_mm": "mm", "y_mm": "mm", "theta_deg": "deg", "phi_deg": "deg"}
_PLAIN = {name.rsplit("_", 1)[0]: name for name in _PLACES}
_COLUMNS = ("unit_id", *_PLACES, "priority", "target_id")

Rows = Sequence[Mapping[str, Any]]


def targets_csv(targets: Any) -> tuple[str, str]:
    """The text for the daemon, and the name by which its errors call the table.

    `targets` is an astropy Table or QTable, a list of dicts, or the path of a CSV file.
    Raises InvalidInput with row and reason.
    """
    if isinstance(targets, (str, os.PathLike)):
        return _read(Path(targets)), Path(targets).name
    if hasattr(targets, "colnames"):
        return _csv({name: _cells(targets[name], name) for name in targets.colnames}), "table"
    if isinstance(targets, Mapping) or not isinstance(targets, Iterable):
        raise InvalidInput(
            f"targets are a table, a list of dicts or a path, not {type(targets).__name__}"
        )
    rows = list(targets)
    for k, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise InvalidInput(f"row {k} is no dict, but {type(row).__name__}")
    names = dict.fromkeys(str(name) for row in rows for name in row)
    return _csv({name: [_scalar(row.get(name), name) for row in rows] for name in names}), "table"


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInput(f"{path}: {error}") from error


def _csv(columns: dict[str, list[Any]]) -> str:
    chosen: dict[str, list[Any]] = {}
    ignored = []
    for name, cells in columns.items():
        known = _known(name)
        if known is None:
            ignored.append(name)
        elif known in chosen:
            raise InvalidInput(f"two columns give {known}; leave one of them")
        else:
            chosen[known] = cells
    if ignored:
        warnings.warn(f"columns that are not used: {', '.join(ignored)}", stacklevel=4)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(chosen)
    places = [name for name in chosen if name in _PLACES]
    for k in range(len(next(iter(chosen.values()), []))):
        if places and all(chosen[name][k] is None for name in places):
            text.write(f"# row {k} has no target\n")
            continue
        writer.writerow([_cell(chosen, name, k) for name in chosen])
    return text.getvalue()


def _known(name: str) -> str | None:
    lower = name.lower()
    return lower if lower in _COLUMNS else _PLAIN.get(lower)


def _cell(columns: dict[str, list[Any]], name: str, row: int) -> str:
    value = columns[name][row]
    if value is None:
        return ""
    if isinstance(value, float) and not math.isfinite(value):
        unit = columns.get("unit_id", {row: None})[row]
        raise InvalidInput(
            f"row {row} (unit {unit}): {name} is {value}; mask the cell where the unit has no "
            "target"
        )
    return str(value)


def _cells(column: Any, name: str) -> list[Any]:
    """The values of a table's column in the daemon's unit; None where masked."""
    known = _known(name)
    if known is None:
        return []
    if getattr(column, "ndim", 1) != 1:
        raise InvalidInput(f"column {name} has more than one value in a row")
    unit = _unit(column, name, known)
    bare = getattr(column, "unmasked", column)
    bare = getattr(bare, "value", getattr(bare, "data", bare))
    values = getattr(bare, "data", bare) if hasattr(bare, "filled") else bare
    if unit is not None:
        values = _converted(values, unit, name, known)
    hidden = getattr(column, "mask", None)
    plain = [_plain(value) for value in values.tolist()]
    if hidden is None:
        return plain
    return [None if is_hidden else value for value, is_hidden in zip(plain, hidden, strict=True)]


def _scalar(value: Any, name: str) -> Any:
    """The value of a dict in the daemon's unit; None where masked."""
    known = _known(name)
    if value is None or known is None or getattr(value, "mask", False):
        return None
    unit = _unit(value, name, known)
    if unit is not None:
        return float(_converted(value.value, unit, name, known))
    return _plain(value.item() if hasattr(value, "item") else value)


def _unit(value: Any, name: str, known: str) -> Any:
    """The unit to convert from; None where the numbers are sent as they are."""
    if known not in _PLACES:
        return None
    unit = getattr(value, "unit", None)
    if unit is None and name.lower() in _PLAIN:
        raise InvalidInput(f"{name} has no unit; give it one, or call it {known}")
    return unit


def _converted(values: Any, unit: Any, name: str, known: str) -> Any:
    try:
        return unit.to(_PLACES[known], values)
    except ValueError as error:  # astropy's UnitConversionError is one
        raise InvalidInput(f"{name}: {unit} cannot be converted to {_PLACES[known]}") from error


def _plain(value: Any) -> Any:
    return value.decode(errors="replace") if isinstance(value, bytes) else value
