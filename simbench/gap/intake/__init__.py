"""May record and baseline be compared, and what is the baseline where none is given?"""
