"""Plot the height of both ankles, live, as bars in the terminal."""

import time

from foottrack_client import Client

with Client() as client, client.subscribe("pose/body") as poses:
    poses.wait_ready()
    while True:
        for message in poses.drain():
            bars = []
            for foot in (message.data.left, message.data.right):
                height_m = foot.ankle.p[1] if foot is not None else 0.0
                bars.append(f"{height_m:6.3f} m {'#' * max(0, round(60 * height_m)):30.30}")
            print("left " + "| right ".join(bars), end="\r", flush=True)
        time.sleep(0.03)
