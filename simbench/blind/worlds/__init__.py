"""One independent simulator a folder: each writes records of loops with one hidden effect, and the truth beside them."""
