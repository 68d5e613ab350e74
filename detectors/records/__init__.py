"""Read the records of control loops from files: tables, time columns, gaps, and the column names of
plant historians.
"""
