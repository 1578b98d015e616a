"""The process that workers are forked from holds nothing of who started it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import os, psutil
from validate.engine.pool import serve
serve(["validate.engine.cell"])
for child in psutil.Process().children():
    if any("forkserver" in word for word in child.cmdline()):
        said = [os.readlink(f"/proc/{child.pid}/fd/{fd}") for fd in (1, 2)]
        print(*said, child.environ()["OPENBLAS_NUM_THREADS"], child.environ().get("PYTHONPATH"))
print("OMP_NUM_THREADS" in os.environ, os.environ["PYTHONPATH"])
"""


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="reads /proc")
def test_it_has_no_output_and_a_clean_environment_and_its_starter_keeps_both() -> None:
    """A pipe behind the command would wait for it, and it imports for seconds."""
    around = {k: v for k, v in os.environ.items() if not k.startswith("OMP_")}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True,
        env={**around, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    server, mine = done.stdout.splitlines()
    assert server == "/dev/null /dev/null 1 None"
    assert mine.startswith("False ")
