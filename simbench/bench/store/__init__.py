"""A run on disk: tables, manifest, checksums."""
