"""Open3D: found, lent what it lacks where that can be had from pip, kept quiet and to one thread."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

from hsslam.matching import MatcherUnavailableError

INSTALL = "pip install 'hsslam[icp]'"

SYSTEM_LIBRARIES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libusb-1.0.so.0": "libusb-1.0-0",
}
"""What Open3D's Linux wheels link to but do not bring, and the Debian packages that hold it."""


@lru_cache(maxsize=1)
def open3d() -> Any:
    """Import Open3D, quietly.

    Raises
    ------
    MatcherUnavailableError
        It, or a system library that it links to, is missing.
    """
    if sys.platform == "linux":
        _lend_libusb()
    try:
        import open3d as module
    except (ImportError, OSError) as error:
        missing = _missing_libraries() if sys.platform == "linux" else []
        if _is_absent(error, "open3d"):
            raise MatcherUnavailableError("icp", "the package open3d is not installed", INSTALL) from error
        if missing:
            packages = " ".join(SYSTEM_LIBRARIES[name] for name in missing)
            raise MatcherUnavailableError(
                "icp",
                f"Open3D needs system libraries that this machine lacks: {', '.join(missing)}",
                f"sudo apt-get install --no-install-recommends {packages}",
            ) from error
        reason = f"open3d cannot be imported: {error}"
        raise MatcherUnavailableError("icp", reason, f"{INSTALL} --force-reinstall") from error
    module.utility.set_verbosity_level(module.utility.VerbosityLevel.Error)
    return module


def _is_absent(error: Exception, package: str) -> bool:
    return isinstance(error, ModuleNotFoundError) and error.name == package


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _missing_libraries() -> list[str]:
    return [name for name in SYSTEM_LIBRARIES if not _loads(name)]


def _lend_libusb() -> None:
    """Load libusb from the pip package where the system has none, so that Open3D finds it in the process."""
    if _loads("libusb-1.0.so.0"):
        return
    try:
        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    except (ImportError, OSError):
        return  # importing Open3D fails then, and that failure names libusb


class _GlobalControl(ctypes.Structure):
    """oneTBB's ``global_control``: parameter 0 is the number of threads allowed."""

    _fields_ = [("value", ctypes.c_size_t), ("reserved", ctypes.c_ssize_t), ("parameter", ctypes.c_int)]


_CREATE = "_ZN3tbb6detail2r16createERNS0_2d114global_controlE"
_DESTROY = "_ZN3tbb6detail2r17destroyERNS0_2d114global_controlE"


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep Open3D to the calling thread.

    It sums in parallel, in the order in which threads happen to finish, so that the last digits of an answer
    would differ from call to call; on a scan of some hundred points threads gain nothing either. Open3D has
    no setting for it, so this asks the TBB library that it brings.
    """
    tbb = _tbb()
    if tbb is None:
        yield
        return
    control = _GlobalControl(1, 0, 0)
    getattr(tbb, _CREATE)(ctypes.byref(control))
    try:
        yield
    finally:
        getattr(tbb, _DESTROY)(ctypes.byref(control))


@lru_cache(maxsize=1)
def _tbb() -> ctypes.CDLL | None:
    folder = Path(open3d().__file__).parent
    for path in sorted(folder.glob("*libtbb*")) + sorted(folder.glob("*/*libtbb*")):
        library = ctypes.CDLL(str(path))
        if hasattr(library, _CREATE) and hasattr(library, _DESTROY):
            return library
    return None
