"""Where MAVLink meets sockets, serial lines and time: links, and the shell of the bridge."""
