"""Builds the example monitors of docs/examples as a user outside the project would."""

import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[3]


def build(example, folder):
    """The folder with the program."""
    folder = pathlib.Path(folder, example)
    configure = ["cmake", "-S", ROOT / "docs/examples" / example, "-B", folder, "-G", "Ninja",
                 f"-DFOCALFLEET_IDL={ROOT / 'daemon/dds/focalfleet.idl'}"]  # fmt: skip
    for command in (configure, ["cmake", "--build", folder]):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning:" not in done.stdout + done.stderr, done.stdout + done.stderr
    return folder
