"""One effect per file: what it does to a loop, or to the record of it, and with what it is confused."""
