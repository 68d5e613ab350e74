"""Write pages about records: the conclusion, the signals, and the verdict of every method."""
