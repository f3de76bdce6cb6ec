"""The other end, simulated: the demo and the tests let these send."""
