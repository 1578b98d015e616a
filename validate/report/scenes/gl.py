"""Safe test for off-screen rendering on this machine.

Without GL libraries VTK ends the process with a segmentation fault at its first window, so the
first window is opened in a process of its own. `VALIDATE_NO_GL=1` answers no at once.
"""

import os
import subprocess
import tempfile
from pathlib import Path
from threading import Lock, Thread

from validate.child_process import clean_environment, python

HOW_TO_GET = (
    "Three-dimensional renders are missing: this machine has no OpenGL library. On Debian or "
    "Ubuntu install libegl1 and libgl1-mesa-dri (or libosmesa6) and run again."
)
_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
_WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
_PROBE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(16, 16))
plotter.add_mesh(pyvista.Sphere(), color="black")
pixels = plotter.screenshot(return_img=True)
raise SystemExit(0 if pixels.min() < pixels.max() else 1)
"""
_TIMEOUT = 60.0  # s: a cold start of VTK on a slow disk
_ONE_PROBE = Lock()
_KNOWN: list[str] = []  # the window class that opens, "" for none, once that is known


def ask() -> None:
    """Begin to find out beside what comes next, for `available` to answer at once later."""
    Thread(target=available, daemon=True).start()


def available() -> bool:
    """True when a window opened elsewhere; sets VTK's window class for this process then.

    Call before the first import of vtk or pyvista.
    """
    if os.environ.get("VALIDATE_NO_GL") == "1":
        return False
    with _ONE_PROBE:
        if not _KNOWN:
            chosen = os.environ.get(_VARIABLE, "")
            candidates = (chosen,) if chosen else _WINDOWS
            _KNOWN.append(next((window for window in candidates if _opens(window)), ""))
        if _KNOWN[0]:
            os.environ[_VARIABLE] = _KNOWN[0]
    return bool(_KNOWN[0])


def known() -> tuple[str, ...]:
    """What this process found out, for others of this machine to `learn`; nothing where it was not
    asked."""
    with _ONE_PROBE:
        return tuple(_KNOWN)


def learn(known: tuple[str, ...]) -> None:
    """Take over what another process of this machine found out."""
    _KNOWN[:] = known or _KNOWN


def _opens(window: str) -> bool:
    with tempfile.TemporaryDirectory(prefix="validate-") as folder:
        try:
            done = subprocess.run(
                python("-c", _PROBE),
                cwd=folder,
                env={**clean_environment(Path(folder)), _VARIABLE: window},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=_TIMEOUT,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return False
    return done.returncode == 0
