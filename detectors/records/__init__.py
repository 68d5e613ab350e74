"""How a file becomes a record: tables, times, holes, and the words of historians."""
