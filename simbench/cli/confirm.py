"""The verbs of `simbench confirm`: tests on the loop that confirm that the valve sticks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from simbench.cli.common import (
    Json,
    confirm_app,
    examples,
    reads,
    refuse_picture,
    say_assumed,
    show_result,
)
from simbench.detectors.errors import ParameterError, naming

if TYPE_CHECKING:
    from simbench.detectors.record import LoopRecord
Loop = Annotated[Path | None, Argument(metavar="LOOP.toml", help="Simulate the test on this loop.")]
Picture = Annotated[Path | None, Option(help="Draw a picture to this file (SVG or PNG).")]


@confirm_app.command("gain-change", epilog=examples("confirm gain-change loop.toml"))
@reads
def gain_change(
    loop: Loop = None,
    records: Annotated[
        tuple[Path, Path] | None,
        Option(
            metavar="BEFORE.csv AFTER.csv",
            help="Read these two records of the test instead of simulating a loop.",
        ),
    ] = None,
    ratio: Annotated[
        float | None,
        Option(
            "--ratio",
            "--factor",
            metavar="R",
            help=(
                "State the new controller gain divided by the old; without it, it is estimated "
                "from the records."
            ),
        ),
    ] = None,
    picture: Picture = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Test whether the oscillation answers a change of the controller gain as friction does.

    The period of a cycle that stiction causes changes with the gain; that of a loop with a sound
    valve changes otherwise, or the oscillation dies out; that of an oscillation from outside does
    not change. Which of them it is like is told by simulations of the loop. Kc is the controller
    gain, OP the controller output.
    """
    _need_one("confirm gain-change", loop, "--records BEFORE.csv AFTER.csv", records)
    refuse_picture(picture, loop, *(records or ()))
    read: list[LoopRecord] = []
    if loop is None:
        from simbench.detectors.records.io import read_record
        from simbench.gap.gain_pair import gain_change_recorded

        assert records is not None
        read = [read_record(path, **about) for path in records]
        result = gain_change_recorded(read[0], read[1], ratio)
    else:
        from simbench.confirm.gain_change import gain_change as test
        from simbench.scenarios.spec import load_loop

        with naming(loop):
            if ratio is None:
                result = test(load_loop(loop))
            else:
                result = test(load_loop(loop), ratio)
    _show_outcome(result, picture, as_json)
    say_assumed(read, as_json)


@confirm_app.command(epilog=examples("confirm travel loop.toml --picture travel.svg"))
@reads
def travel(
    loop: Loop = None,
    record: Annotated[
        Path | None,
        Option(
            metavar="REC.csv",
            help="Read this record of a travel test instead of simulating a loop.",
        ),
    ] = None,
    picture: Picture = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Run a valve travel test: step OP slightly in both directions until PV moves.

    The output gives the slip-jump J (OP change until the valve moves in the same direction) and the
    stick band S (after a reversal), and grades gain, noise, hysteresis and stiction by Table 11.1
    of the book chapter that simbench implements.
    """
    _need_one("confirm travel", loop, "--record REC.csv", record)
    refuse_picture(picture, loop, record)
    read: list[LoopRecord] = []
    if loop is None:
        from simbench.confirm.recorded import travel_recorded
        from simbench.detectors.records.io import read_record

        assert record is not None
        read = [read_record(record, **about, automatic=False)]  # such a test is made by hand
        result = travel_recorded(read[0])
    else:
        from simbench.confirm.grade import graded_test
        from simbench.scenarios.spec import load_loop

        with naming(loop):
            result = graded_test(load_loop(loop))
    _show_outcome(result, picture, as_json)
    say_assumed(read, as_json)


def _need_one(verb: str, loop: Path | None, option: str, other: Any) -> None:
    if (loop is None) == (other is None):
        raise ParameterError(f"{verb} needs either a loop file, or {option}")


def _show_outcome(result: Any, picture: Path | None, as_json: bool) -> None:
    if picture is not None:
        from simbench.page.style import write_picture

        write_picture(result.plot(), picture)
    show_result(result, as_json)
