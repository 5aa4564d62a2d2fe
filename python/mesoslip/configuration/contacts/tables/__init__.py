"""The tables of the contacts, one a file."""
