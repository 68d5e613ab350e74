"""Show the answer of a diagnosis as data, text, pictures and HTML page."""
