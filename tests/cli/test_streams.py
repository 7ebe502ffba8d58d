"""What the commands do with their output streams."""

from __future__ import annotations

import subprocess
import sys


def test_a_reader_that_stops_reading_is_no_error():
    """As with ``deltaopt check SCENE | head -1``: no message, and the exit code of SIGPIPE."""
    command = [sys.executable, "-u", "-m", "deltaopt", "check", "problems/pick_and_place.yaml"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141
