"""Physics shared by the friction models: spring-and-diaphragm actuator, exact motion between stops,
fixed sub-steps.
"""
