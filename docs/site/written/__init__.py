"""Pages that are written when the site is built: from docstrings, schemas, rules and results, so
that none can be stale.
"""
