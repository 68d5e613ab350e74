"""What every detector must keep, tried on plain, rescaled and dead records."""
