"""What was found, as arrays with named fields, and its tables and files. No room of a solver is known here."""
