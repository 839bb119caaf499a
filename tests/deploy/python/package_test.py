"""The package itself: its version, its types, what it imports, and what is installed."""

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import zipfile

import focalfleet

ROOT = pathlib.Path(__file__).resolve().parents[3]
PACKAGE = ROOT / "deploy/python"


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stdout + done.stderr


class Package(unittest.TestCase):
    def test_cmake_has_the_same_version(self):
        text = (ROOT / "CMakeLists.txt").read_text()
        version = re.search(r"project\(focalfleet VERSION (\S+)", text)
        self.assertEqual(version[1], focalfleet.__version__)

    def test_only_the_standard_library_is_imported_at_first(self):
        code = "import focalfleet, sys; assert not {'astropy', 'numpy'} & set(sys.modules)"
        run(sys.executable, "-c", code)

    def test_measurements_are_a_list_without_astropy(self):
        code = (
            "import sys; sys.modules['astropy.table'] = None; from focalfleet.results import table_of;"
            "assert table_of([], {}) == []; from focalfleet.tables import targets_csv;"
            "assert targets_csv([{'unit_id': 1}])[0] == 'unit_id\\n1\\n'"
        )
        run(sys.executable, "-c", code)

    def test_types_are_strict(self):
        with tempfile.TemporaryDirectory() as folder:
            options = ["--config-file", PACKAGE / "pyproject.toml", "--cache-dir", folder]
            run("mypy", *options, PACKAGE / "focalfleet")

    def test_a_wheel_has_every_module(self):
        with tempfile.TemporaryDirectory() as folder:
            run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=PACKAGE)
            (wheel,) = pathlib.Path(folder).iterdir()
            self.assertEqual(wheel.name, f"focalfleet-{focalfleet.__version__}-py3-none-any.whl")
            packed = {name for name in zipfile.ZipFile(wheel).namelist() if "dist-info" not in name}
        kept = [*PACKAGE.glob("focalfleet/*.py"), PACKAGE / "focalfleet/py.typed"]
        self.assertEqual(packed, {f"focalfleet/{path.name}" for path in kept})


if __name__ == "__main__":
    unittest.main()
