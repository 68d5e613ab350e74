"""A co-simulation unit (FMI 2.0) as the plant, stepped through fmpy: `pip install
"stiction-simbench[fmi]"`.

Runs in plain Python. The unit's input is MV (%), its output PV; it must come to rest
under MV = op0, PV = pv0.
"""

import os

from simbench.loop.parameters import Number

SOURCE = "FMI 2.0 for co-simulation, modelica.org"
INTEGRATING = False
PARAMETERS = {
    "settle": Number(
        "s", low=0.0, default=0.0, says="time the unit is run under MV = op0 before the loop closes"
    )
}
UNIT, INPUT, OUTPUT = os.environ.get("PLANT_FMU", "plant.fmu"), "mv", "pv"


def start(p):
    """Return the state (deviation of PV, the unit, references of input and output, time) after the
    unit has settled.
    """
    import fmpy

    about = fmpy.read_model_description(UNIT)
    names = {v.name: v.valueReference for v in about.modelVariables}
    unit = fmpy.instantiate_fmu(fmpy.extract(UNIT), about, "CoSimulation")
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.setReal([names[INPUT]], [p.op0])
    unit.exitInitializationMode()
    if p.settle > 0.0:
        unit.doStep(0.0, p.settle)
    return 0.0, unit, names[INPUT], names[OUTPUT], p.settle


def step(w_old, w_new, state, p):
    """One sample of the unit under the MV of the whole dead time before; a part of a sample is
    rounded away.
    """
    _, unit, mv, pv, t = state
    unit.setReal([mv], [p.op0 + w_new])
    unit.doStep(t, p.Ts)
    return unit.getReal([pv])[0] - p.pv0, unit, mv, pv, t + p.Ts
