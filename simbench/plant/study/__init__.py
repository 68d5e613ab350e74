"""Compare a set of records with a grid (`simbench gap study`)."""
