"""`simbench.Loop`: a loop that simulates itself, predicts its cycle and plots itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Required, Self, TypedDict, Unpack

from simbench.detectors.views import page_part
from simbench.loop.plant import table_of
from simbench.loop.run import Run
from simbench.loop.simulate import simulate
from simbench.scenarios import spec
from simbench.theory.predict import predict

if TYPE_CHECKING:
    import pandas as pd

_Table = Mapping[str, Any]


class _System(Protocol):
    """A linear system of python-control: `control.tf(...)`, `control.ss(...)`."""

    ninputs: Any
    noutputs: Any
    dt: Any


class _Sections(TypedDict, total=False):
    """Sections of a loop, as in a loop file; times in s, OP, MV and valve parameters in %."""

    plant: Required[_Table | _System]
    controller: Required[_Table]
    sampling: Required[_Table]
    valve: _Table
    noise: _Table
    setpoint: _Table
    archive: _Table
    operating_point: _Table
    disturbance: Sequence[_Table]
    effect: Sequence[_Table]
    outer: _Table


class Loop(spec.Loop):
    """One control loop that simulates itself.

    Parameters
    ----------
    plant : mapping or control.TransferFunction or control.StateSpace
        type "foptd" or "integrating", K (PV units per %, integrating: per % and s), T, Td (s); type
        "tf", num and den (falling powers of s, or of z with dt = Ts), Td; or a plug-in's name and
        its parameters. A system of python-control is a "tf" without dead time.
    controller : mapping
        type "PI", "P" or "PID", Kc (% per PV unit), Ti (s), direction "reverse" or "direct"; PID:
        Td (s), N, form, b, c, anti_windup, Tt (s), schedule, schedule_on; type "tf": num, den, dt
        (s), from the error to OP; or a plug-in's name and its parameters.
    sampling : mapping
        Ts (s), n.
    operating_point : mapping, optional
        op0 (%), pv0 (PV units).
    valve : mapping, optional
        model and its parameters (%); ideal when absent.
    noise : mapping, optional
        std (PV units).
    setpoint : mapping, optional
        value, steps as pairs of time (s) and value.
    archive : mapping, optional
        op_step (%), pv_step (PV units), op_held and pv_held (0 or 1 a sample): how the record is
        written.
    disturbance, effect : sequence of mappings, optional
        type or name, and its parameters.
    outer : mapping, optional
        Outer loop of a cascade, whose OP is this loop's set point: plant, controller, setpoint,
        noise, sp_span.

    Raises
    ------
    SpecError
        One sentence: the key, its value, what is allowed, the nearest known key.

    Examples
    --------
    >>> loop = Loop(
    ...     plant={"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     controller={"type": "PI", "Kc": 1, "Ti": 10},
    ...     valve={"model": "choudhury", "S": 5, "J": 2},
    ...     sampling={"Ts": 1, "n": 600}, setpoint={"steps": [[10, 55]]})
    >>> loop.simulate(seed=1).record.n
    600
    """

    def __init__(self, **sections: Unpack[_Sections]) -> None:
        table: dict[str, Any] = dict(sections)
        if not isinstance(table.get("plant", {}), (Mapping, spec.Plant)) and hasattr(
            table["plant"], "ninputs"
        ):
            table["plant"] = table_of(table["plant"])
        checked = spec.Loop.from_table(table, "Loop")
        super().__init__(**dict(checked))  # pyright: ignore[reportCallIssue]

    @classmethod
    def from_table(cls, table: dict[str, Any], where: str = "loop") -> Self:
        """Check a nested table, as TOML gives it, and return the loop.

        Parameters
        ----------
        table : dict
            Keys of the loop file.
        where : str
            File name for messages.

        Returns
        -------
        Loop
            The loop, every value of it checked.

        Raises
        ------
        SpecError
            As the constructor.
        """
        return cls(**dict(spec.Loop.from_table(table, where)))

    def simulate(self, seed: int = 0, *, kick: float = 0.0) -> Run:
        """Run the loop from rest.

        Parameters
        ----------
        seed : int
            Root of every random stream; the same loop and seed give the same bits.
        kick : float
            Offset (%) of OP at sample 0.

        Returns
        -------
        Run
            Its `record` is what a plant would have recorded.

        Raises
        ------
        UnknownName, ParameterError
            For a plug-in that does not exist, or numbers it does not allow.
        """
        return simulate(self, seed, kick=kick)

    def predict(self) -> dict[str, Any]:
        """Say what theory expects of the loop, see `simbench.predict`.

        Returns
        -------
        dict
            Prediction by theory to its result, as `simbench.predict` returns it.
        """
        return predict(self)

    def to_frame(self) -> pd.DataFrame:
        """Return the loop as a table.

        Returns
        -------
        DataFrame
            Columns section, key, value; one row per entry of the loop file.
        """
        import pandas as pd

        rows = []
        for section, content in self.to_table().items():
            for part in content if isinstance(content, list) else [content]:
                for key, value in part.items():
                    rows.append({"section": section, "key": key, "value": value})
        return pd.DataFrame(rows)

    def _repr_html_(self) -> str:
        frame = self.to_frame()
        return page_part(
            f"loop with valve model {self.valve.name}", frame.assign(value=frame["value"].map(str))
        )


def load_loop(path: str | Path) -> Loop:
    """Read a loop file.

    Parameters
    ----------
    path : str or Path
        Loop file (TOML).

    Returns
    -------
    Loop
        The loop, every value of it checked.

    Raises
    ------
    SpecError
        When the file is missing, is no TOML (with the line), or asks for something impossible.
    """
    return Loop.from_table(spec.read_loop(path), str(path))
