"""Simulated hardware, plugged in: what `foottrack demo` wears, and the service finds through its ordinary nodes."""
