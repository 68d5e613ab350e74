"""Controllers by a law of their own, one per file; P, PI and PID stand in
`simbench.loop.controller`.
"""
