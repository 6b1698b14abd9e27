"""Process models: the load on the tool, from where it is and what the path says; one a file."""
