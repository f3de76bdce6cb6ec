"""To applications that speak other protocols: one file each, one interface, off unless the settings say so."""
