"""One file per detector; the file name is the method id."""
