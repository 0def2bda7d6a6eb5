#!/usr/bin/env python3
"""A simulated MAVLink vehicle for packaging/try_packages: it hovers, and sends its heartbeat,
attitude and position to a UDP port of this computer until it is ended.

usage: vehicle.py PYMAVLINK PORT      (PYMAVLINK: the folder .cache/mavlink)
"""

import socket
import sys
import time

sys.path.insert(0, sys.argv[1])
from pymavlink.dialects.v20 import common as mavlink  # noqa: E402

link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for number in range(3000):
    milliseconds = 1000 + 20 * number
    messages = [mavlink.MAVLink_attitude_message(milliseconds, 0.05, -0.08, 0.9, 0, 0, 0),
                mavlink.MAVLink_local_position_ned_message(milliseconds, 0, 0, -1.5, 0, 0, 0)]
    if number % 50 == 0:
        messages.append(mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 0, 0,
            mavlink.MAV_STATE_ACTIVE, 3))
    for message in messages:
        port.sendto(message.pack(link), ("127.0.0.1", int(sys.argv[2])))
        link.seq = (link.seq + 1) % 256
    time.sleep(0.02)
