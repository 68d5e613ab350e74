"""What should happen? Describing functions, the exact cycle of the sampled loop, the chapter's
tables.
"""
