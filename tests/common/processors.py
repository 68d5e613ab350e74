"""Run a program as other processors would: what numpy and BLAS choose by the processor is set by
their variables.
"""

import os
import subprocess
import sys

# what the Makefile or a shell may have set
_CHOICES = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "NUMBA_CPU_NAME")
_NO_512 = {"OPENBLAS_CORETYPE": "Haswell"}
PROCESSORS = {
    "as it is": {},
    "BLAS without AVX-512": _NO_512,
    "without AVX-512": {**_NO_512, "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"},
}
# what is older still, for what takes no time
OLDER = {
    "without AVX": {
        "OPENBLAS_CORETYPE": "Nehalem",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    }
}


def on(processor: dict[str, str], *command: str) -> subprocess.CompletedProcess:
    """Run Python with such a command as that processor would."""
    kept = {k: v for k, v in os.environ.items() if k not in _CHOICES}
    return subprocess.run(
        [sys.executable, *command],
        env={**kept, **processor},
        capture_output=True,
        text=True,
        check=False,
    )
