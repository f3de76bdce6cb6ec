"""Print both feet, live. Start `foottrack demo` beside it."""

from foottrack_client import Client

with Client() as client, client.subscribe("pose/body") as poses:
    for message in poses:
        for side, foot in (("left", message.data.left), ("right", message.data.right)):
            if foot is not None:
                x, y, z = foot.ankle.p
                print(
                    f"{side:5}  {x:6.3f} {y:6.3f} {z:6.3f} m  {'on' if foot.contact else 'off'} the floor  {foot.stage}"
                )
