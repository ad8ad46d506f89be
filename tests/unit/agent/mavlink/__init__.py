"""Tests of the MAVLink bridge, in virtual time and without sockets."""
