"""A mission live in Foxglove: the messages of a recording, over a websocket as they come."""
