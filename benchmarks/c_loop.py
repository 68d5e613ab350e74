"""The closed loop compiled from loop.c by gcc, called through ctypes."""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

SOURCE = Path(__file__).with_name("loop.c")
FLAGS = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]


def build():
    """Compile loop.c and return its function, or None where there is no gcc."""
    if shutil.which("gcc") is None:
        return None
    library = Path(tempfile.mkdtemp()) / "loop.so"
    subprocess.run(["gcc", *FLAGS, str(SOURCE), "-o", str(library), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).closed_loop
    size, real = ctypes.c_ssize_t, ctypes.c_double
    array = ctypes.c_void_p  # bare addresses: checking arrays would be timed as part of C's time
    function.argtypes = [size, size, *[array] * 4, real, array, *[real] * 8, *[array] * 3]
    function.restype = None
    return function
