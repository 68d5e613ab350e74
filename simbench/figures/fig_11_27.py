"""Figure 11.27: the stiction diagnosis procedure, drawn from the program's steps.

Questions run downwards, each answer leads to the next question or to a conclusion with its next
test. Unlike in the chapter a nonlinearity that is not seen does not end the search (symmetric
cycles hide from the bicoherence), and a loop that does not oscillate is still judged where its
valve can be seen.
"""

from simbench.figures._chart import draw_flow, flow_table

SOURCE = "Jelali (2013), Fig. 11.27 and Sect. 11.9; detectors/procedure.py"
data = flow_table
draw = draw_flow
