"""Parts of a loop that are stated in powers of z, sample by sample."""
