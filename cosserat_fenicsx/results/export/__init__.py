"""Results leave the program: files, tables, dictionaries, other libraries, notebooks."""
