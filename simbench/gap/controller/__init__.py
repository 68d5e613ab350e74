"""Does the PI law turn the recorded error into the recorded OP, and if not, what lies between?"""
