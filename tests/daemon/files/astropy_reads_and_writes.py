"""astropy writes a table, fits_copy reads and writes it, astropy reads it: nothing changed."""
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from astropy.table import Table

with tempfile.TemporaryDirectory() as folder:
    theirs, ours = Path(folder, "theirs.fits"), Path(folder, "ours.fits")
    table = Table(
        {
            "UNIT_ID": np.arange(1, 1001, dtype=np.int64),
            "X_MM": np.random.default_rng(1).normal(size=1000),
            "NOTE": [f"unit {i}" for i in range(1, 1001)],
        },
        meta={"EXTNAME": "TARGETS", "DATE-OBS": "2026-11-22T03:04:05.678"},
    )
    table["X_MM"].unit = "mm"
    table["X_MM"][17] = np.nan
    table.write(theirs)
    subprocess.run([sys.argv[1], theirs, ours], check=True)
    back = Table.read(ours)
    assert back.colnames == table.colnames, back.colnames
    assert back.meta["EXTNAME"] == "TARGETS"
    assert str(back["X_MM"].unit) == "mm"
    assert (back["UNIT_ID"] == table["UNIT_ID"]).all()
    assert np.array_equal(np.ma.filled(back["X_MM"], np.nan), np.asarray(table["X_MM"]), equal_nan=True)
    # FITS pads text with blanks, which mean nothing.
    assert list(np.char.rstrip(back["NOTE"].astype(str))) == list(table["NOTE"].astype(str))
    truncated = Path(folder, "truncated.fits")
    truncated.write_bytes(theirs.read_bytes()[:4000])
    broken = subprocess.run([sys.argv[1], truncated, Path(folder, "none.fits")], capture_output=True, text=True)
    assert broken.returncode == 1 and "truncated.fits" in broken.stderr, broken.stderr
    assert not Path(folder, "none.fits").exists()
print("1000 rows came back as they went")
