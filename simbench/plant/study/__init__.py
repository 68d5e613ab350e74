"""A set of records against a grid."""
