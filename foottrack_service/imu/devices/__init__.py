"""The other end of the cable, simulated: the demo and the tests plug these into a pty or a socket."""
