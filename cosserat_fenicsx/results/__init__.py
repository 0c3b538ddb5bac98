"""Results as arrays with named fields, and their tables and files. This package imports no solver."""
