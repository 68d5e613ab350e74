"""Each method's hard negative, kept: `python -m results.studies.hard_negatives METHOD ...` runs
`simbench worst` for it.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path
from typing import Any

from simbench.bench.worst import WorstCase, worst
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods as registry
from simbench.files import whole_file
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import load_loop
from simbench.usage import exit_code

HARD_NEGATIVES = Path(__file__).parents[1] / "hard_negatives"


def read_case(path: str | Path) -> WorstCase:
    """Read a loop file that `WorstCase.to_toml` wrote, and judge it again."""
    loop, head = load_loop(path), recorded(path)
    verdict = judge(simulate(loop, head["seed"]).record, [head["method"]])[0]
    return WorstCase(head["method"], loop, head["seed"], verdict, tried=1, drawn=0, fooled=0)


def recorded(path: str | Path) -> dict[str, Any]:
    """Return what the comments of a case say: method, seed, verdict, score."""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    comments = tomllib.loads(
        "\n".join(line[2:] for line in lines if line.startswith("# ") and " = " in line)
    )
    missing = [k for k in ("method", "seed", "verdict", "score") if k not in comments]
    if missing:
        raise UserError(
            f"{path}: no comment says {' and '.join(missing)}; write such files with `simbench"
            " worst`"
        )
    return comments


def main(arguments: list[str] | None = None) -> int:
    """Search and write one case per method, or judge the written ones again."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.hard_negatives", description=__doc__
    )
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="method ids")
    parser.add_argument("--all", action="store_true", help="every method")
    parser.add_argument(
        "--rejudge", action="store_true", help="keep the loops, write today's answers"
    )
    parser.add_argument("--budget", type=int, default=2000, help="loops to try for each method")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    for name in registry.names() if chosen.all else chosen.methods:
        path = HARD_NEGATIVES / f"{name}.toml"
        case = read_case(path) if chosen.rejudge else worst(name, chosen.budget, chosen.seed)
        with whole_file(path) as f:
            f.write(case.to_toml())
        print(case.as_text().partition("\n\n")[0] + "\n", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
