"""Plants by a law of their own, one per file; first order, integrator and num/den stand in
`simbench.loop.plant`.
"""
