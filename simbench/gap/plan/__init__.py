"""Choose the next test on the plant: the possible tests, sized for the loop, and what each is
expected to tell (`simbench gap plan`).
"""
