"""The person's own calibrations: floor, heading, body and the camera's mount. What decides is pure; node.py waits."""
